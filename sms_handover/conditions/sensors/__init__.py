"""Sensors: what is known of robot and deputy where the truth is not."""
