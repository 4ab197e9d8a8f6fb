"""A node that does not belong to a run and talks into it: ``python intruder.py TOPIC KIND``.

Once it gets a line it publishes bad messages until it is ended; until then it is there, and says and
offers nothing. It prints a line once it has found a reader and sent some.
"""

import sys
from collections.abc import Callable
from math import inf, nan
from time import sleep
from typing import Any

import rclpy
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.serialization import serialize_message

from sms_handover.graph.topics import graph_topics
from sms_handover.ros.message_types import message_class
from sms_handover.ros.qos import profile_of

_ARMS = ("arm_a", "arm_b")
_JOINTS = [f"{arm}_joint_{number}" for arm in _ARMS for number in range(1, 8)]
_PAUSE_S = 0.01  # s of wall time between two messages
_ENOUGH = 20  # messages after which the intruder says that it has talked
_LATE_S = 40  # s of simulation time, after the end of the runs that are tried
_LARGE = 100_000  # bytes behind the end of a message


def _joints(message: Any, value: float) -> None:
    message.name = _JOINTS
    message.position, message.velocity, message.effort = [[value] * len(_JOINTS)] * 3


def _spoil(message: Any, kind: str) -> bytes:
    """Return the bytes of a message that is good but for what ``kind`` says."""
    number = {"nan": nan, "infinite": inf}.get(kind, 0.5)
    if hasattr(message, "effort"):
        _joints(message, number)
    if hasattr(message, "child_frame_id"):
        message.header.frame_id, message.child_frame_id = "world", "base_link"
        message.pose.pose.position.x = number
        message.pose.pose.orientation.w = 2.0 if kind == "not-unit" else 1.0
    elif hasattr(message, "pose"):
        message.header.frame_id = "world"
        message.pose.position.x = number
    if kind == "other-frame":
        message.header.frame_id = "elsewhere"
    if kind == "other-names":
        message.name = [f"other_{name}" for name in _JOINTS]
    if kind == "over":
        message.state = message.FINISHED
    if kind == "missed":
        message.status = message.MISSED
    if kind == "lie":
        message.node, message.topics, message.counts = "plant", ["/joint_states"], [10**9]
    if kind == "future":
        stamp = message.stamp if hasattr(message, "stamp") else message.header.stamp
        stamp.sec = _LATE_S
    data: bytes = serialize_message(message)
    return {"truncated": data[: len(data) // 2], "oversized": data + bytes(_LARGE)}.get(kind, data)


def _talk(node: Node, name: str, kind: str) -> Callable[[], None]:
    """Return what sends one bad message."""
    topic = next(topic for topic in graph_topics(_ARMS) if topic.name == name)
    publisher = node.create_publisher(message_class(topic.type), name, profile_of(topic))
    while not publisher.get_subscription_count():
        sleep(_PAUSE_S)
    data = _spoil(message_class(topic.type)(), kind)
    return lambda: publisher.publish(data)


def _set(node: Node, parameter: str) -> Callable[[], None]:
    """Return what asks the plant to change a parameter, and prints what it answers."""
    client = node.create_client(SetParameters, "plant/set_parameters")
    client.wait_for_service()
    value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=0.002)
    if parameter == "use_sim_time":
        value = ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=True)
    request = SetParameters.Request(parameters=[Parameter(name=parameter, value=value)])

    def ask() -> None:
        future = client.call_async(request)
        rclpy.spin_until_future_complete(node, future, timeout_sec=5.0)
        answer = future.result()
        if answer is not None:
            print(answer.results[0].successful, answer.results[0].reason, flush=True)

    return ask


def main() -> None:
    """Talk until ended."""
    name, kind = sys.argv[1:]
    rclpy.init()
    node = Node("intruder", start_parameter_services=False, enable_rosout=False)
    sys.stdin.readline()
    act = _set(node, kind) if name == "parameters" else _talk(node, name, kind)
    for count in range(10**9):
        act()
        sleep(_PAUSE_S)
        if count == _ENOUGH:
            print("talked", flush=True)


if __name__ == "__main__":
    main()
