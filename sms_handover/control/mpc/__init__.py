"""Predictive control with constraints: the plan of a horizon by a quadratic program, and the loop that follows it."""
