"""Inverse kinematics (IK) with the base locked."""
