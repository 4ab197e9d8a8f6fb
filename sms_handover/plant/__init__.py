"""The plant: forward dynamics of the spacecraft, integrators, and the deputy with its attachment."""
