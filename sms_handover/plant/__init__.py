"""The simulated spacecraft: forward dynamics, integrators, and the deputy with its attachment."""
