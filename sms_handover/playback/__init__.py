"""Playback without ROS: clock, schedule, source and QoS."""
