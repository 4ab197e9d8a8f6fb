"""Trajectory of a task: schedule, phases, target poses, joint references."""
