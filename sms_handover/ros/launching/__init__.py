"""Launching with ``ros2 launch``: its arguments, and which processes make a graph."""
