"""Conditions: what is not ideal about a run, each effect on its own and from its own random stream."""
