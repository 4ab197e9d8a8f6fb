"""Codecs between values of the core and ROS messages, as objects and as CDR bytes."""
