"""Messages without ROS: their definitions, their bytes, and the values in them."""
