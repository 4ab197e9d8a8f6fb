"""What joins the core to ROS 2: messages, endpoints, parameters, stamps and spinning."""
