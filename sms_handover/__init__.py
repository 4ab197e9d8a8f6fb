"""Free-floating dual-arm handover: a ROS 2 graph and the numerical core it runs on."""

__version__ = "0.1.0"
