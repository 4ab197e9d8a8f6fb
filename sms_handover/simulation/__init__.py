"""Simulation: the whole loop in one process, by plain calls instead of messages."""
