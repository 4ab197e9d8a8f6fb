"""Bags: recordings as MCAP files in the layout of rosbag2, written and read without ROS."""
