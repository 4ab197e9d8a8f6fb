"""Balancer: a control law whose idle arm moves so that the base keeps its attitude."""
