"""Prints the topics of a graph that a ROS process of whatever settings finds, its own left out."""

from time import monotonic

import rclpy
from rclpy.node import Node

LOOK_S = 4.0  # s of wall time; announcements come each 3 s
OWN = {"/rosout", "/parameter_events"}


def main() -> None:
    """Look for a while."""
    rclpy.init()
    node = Node("stranger")
    seen: set[str] = set()
    end = monotonic() + LOOK_S
    while monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.1)
        seen.update(name for name, _ in node.get_topic_names_and_types())
    print("\n".join(sorted(seen - OWN)))
    rclpy.shutdown()


if __name__ == "__main__":
    main()
