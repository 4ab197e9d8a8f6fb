"""When to send what of a recording: clock, schedule, choice of topics and quality of service, without ROS."""
