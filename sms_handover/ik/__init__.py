"""Inverse kinematics with the base locked: residual, Levenberg-Marquardt, result with status."""
