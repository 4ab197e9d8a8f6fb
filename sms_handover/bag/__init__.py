"""Write and read recordings: MCAP files in the layout of rosbag2, without a ROS installation."""
