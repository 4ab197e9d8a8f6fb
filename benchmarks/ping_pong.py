"""The floor of lock step: two processes hand the loop's messages to each other and compute nothing.

The same bytes, quality of service and way of taking them as in the graph. Run as a module, as ``ping`` or,
for both sides in one process, as ``solo``, it prints the mean time of a round trip in us.
"""

import os
import subprocess
import sys
from collections.abc import Callable
from time import perf_counter

import numpy as np
import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node

from sms_handover.frames import BASE, WORLD
from sms_handover.graph.topics import (
    BASE_ODOMETRY,
    CONTROLLER,
    JOINT_COMMAND,
    JOINT_STATES,
    PLANT,
    graph_topics,
)
from sms_handover.launcher.domain import reserved_domain
from sms_handover.messages.stamps import stamp_ns
from sms_handover.ros.codecs.loop_messages import JointStateCodec, OdometryCodec
from sms_handover.ros.node.endpoints import Endpoints
from sms_handover.ros.process.network_scope import apply_network_scope
from sms_handover.ros.transport.direct import DirectInputs
from sms_handover.ros.transport.inputs import OnSerialized

_ARMS = ("arm_a", "arm_b")
NAMES = [f"{arm}_joint_{number}" for arm in _ARMS for number in range(1, 8)]
_STATE, _COMMAND = (JOINT_STATES, BASE_ODOMETRY), (JOINT_COMMAND,)
_TICK_NS = 1_000_000  # [ns] between two stamps
_WAIT_S = 0.2  # [s] longest sleep


class Side:
    """One of the two nodes: it publishes the messages of a stamp, and sleeps until the other's have come."""

    def __init__(self, name: str, sends: tuple[str, ...], takes: tuple[str, ...]) -> None:
        node = Node(name, start_parameter_services=False, enable_rosout=False)
        endpoints = self._endpoints = Endpoints(node, graph_topics(_ARMS), (PLANT, CONTROLLER))
        self._inputs = DirectInputs(node)
        self._inputs.awaited = lambda: takes[-1]
        self._came = dict.fromkeys(takes, -_TICK_NS)
        self._publish = [endpoints.publisher(topic).publish for topic in sends]
        for topic in takes:
            endpoints.subscribe_serialized(topic, self._inputs, self._taker(topic))
        self._executor = EventsExecutor()
        self._executor.add_node(node)
        zeros = np.zeros(len(NAMES))
        pose, twist = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]), np.zeros(6)
        states = JointStateCodec(NAMES, ("position", "velocity", "effort"))
        odometry = OdometryCodec(WORLD, BASE)
        commands = JointStateCodec(NAMES, ("effort",))
        pack: dict[str, Callable[[int], bytes]] = {
            JOINT_STATES: lambda stamp: states.pack(stamp, position=zeros, velocity=zeros, effort=zeros),
            BASE_ODOMETRY: lambda stamp: odometry.pack(stamp, pose, twist),
            JOINT_COMMAND: lambda stamp: commands.pack(stamp, effort=zeros),
        }
        self._pack = [pack[topic] for topic in sends]

    def match(self) -> None:
        """Wait for the other side."""
        while self._endpoints.unmatched:
            self._executor.spin_once(timeout_sec=_WAIT_S)

    def send(self, stamp: int) -> None:
        """Publish the messages of a stamp."""
        for publish, pack in zip(self._publish, self._pack, strict=True):
            publish(pack(stamp))

    def wait(self, stamp: int) -> None:
        """Sleep until every message of a stamp has come."""
        while min(self._came.values()) < stamp:
            self._inputs.spin_once(self._executor, _WAIT_S)

    def _taker(self, topic: str) -> OnSerialized:
        """Return what notes the stamp of a message."""

        def take(data: bytes, sent_ns: int, publisher: bytes) -> None:
            self._came[topic] = stamp_ns(data)

        return take


def pong(trips: int) -> None:
    """Answer the other process."""
    rclpy.init()
    side = Side(CONTROLLER, _COMMAND, _STATE)
    side.match()
    for trip in range(trips):
        side.wait(trip * _TICK_NS)
        side.send(trip * _TICK_NS)


def ping(trips: int) -> float:
    """Return the mean time in s of a round trip."""
    with reserved_domain(None) as domain:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        command = [sys.executable, "-m", "benchmarks.ping_pong", "pong", str(trips)]
        with subprocess.Popen(command) as other:
            rclpy.init()
            side = Side(PLANT, _STATE, _COMMAND)
            side.match()
            start = perf_counter()
            for trip in range(trips):
                side.send(trip * _TICK_NS)
                side.wait(trip * _TICK_NS)
            elapsed = perf_counter() - start
            other.wait()
    return elapsed / trips


def solo(trips: int) -> float:
    """Return the mean time in s of a round trip between two nodes of this process and thread."""
    with reserved_domain(None) as domain:
        rclpy.init(domain_id=domain)
        sides = Side(PLANT, _STATE, _COMMAND), Side(CONTROLLER, _COMMAND, _STATE)
        for side in sides:
            side.match()
        plant, controller = sides
        start = perf_counter()
        for trip in range(trips):
            plant.send(trip * _TICK_NS)
            controller.wait(trip * _TICK_NS)
            controller.send(trip * _TICK_NS)
            plant.wait(trip * _TICK_NS)
        return (perf_counter() - start) / trips


def main() -> None:
    """Play one of the two sides, or both."""
    os.environ.update(ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST", ROS_STATIC_PEERS="")
    apply_network_scope()
    role, trips = sys.argv[1], int(sys.argv[2])
    if role == "pong":
        pong(trips)
    else:
        print(1e6 * (solo if role == "solo" else ping)(trips))
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
