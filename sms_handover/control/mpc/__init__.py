"""Predictive control with constraints: plans by a quadratic program, and what follows them."""
