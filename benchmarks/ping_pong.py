"""The floor of lock step: two processes hand the loop's messages to each other and compute nothing.

The same bytes, quality of service and way of taking them as in the graph. Run as a module, as ``ping`` or,
for both sides in one process, as ``solo``, it prints the mean time of a round trip in us. Variants of
``ping``: ``spinning``, where both look for what they await before they sleep, as plant and controller do;
``one``, where a state is one message; ``watched``, where a third process takes everything, as the
recorder does.
"""

import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack
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
    RECORDER,
    graph_topics,
)
from sms_handover.launcher.domain import reserved_domain
from sms_handover.messages.stamps import stamp_ns
from sms_handover.ros.codecs.loop_messages import JointStateCodec, OdometryCodec
from sms_handover.ros.node.endpoints import Endpoints
from sms_handover.ros.process.network_scope import apply_network_scope
from sms_handover.ros.process.realtime import stand_back
from sms_handover.ros.transport.direct import DirectInputs
from sms_handover.ros.transport.inputs import OnSerialized
from sms_handover.ros.transport.spinning import AdaptiveSpin

_ARMS = ("arm_a", "arm_b")
NAMES = [f"{arm}_joint_{number}" for arm in _ARMS for number in range(1, 8)]
_STATE, _COMMAND = (JOINT_STATES, BASE_ODOMETRY), (JOINT_COMMAND,)
_TICK_NS = 1_000_000  # [ns] between two stamps
_WAIT_S = 0.2  # [s] longest sleep
_SPIN_S = 0.002  # [s] of wall time to look for a message before that, as plant and controller do
_WATCH_S = 0.002  # [s] of wall time between two looks of the third process, as of the recorder
_NICENESS = 10  # [-] of it, as of the recorder
SPINNING, ONE, WATCHED = "spinning", "one", "watched"


class Side:
    """One of the two nodes: it publishes the messages of a stamp, and sleeps until the other's have come."""

    def __init__(self, name: str, sends: tuple[str, ...], takes: tuple[str, ...], variant: str = "") -> None:
        node = Node(name, start_parameter_services=False, enable_rosout=False)
        peers = (PLANT, CONTROLLER, RECORDER) if variant == WATCHED else (PLANT, CONTROLLER)
        endpoints = self._endpoints = Endpoints(node, graph_topics(_ARMS), peers)
        self._inputs = DirectInputs(node)
        self._inputs.awaited = lambda: takes[-1]
        self._spin = AdaptiveSpin(_SPIN_S) if variant == SPINNING else None
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
        if variant == ONE:
            parts = pack[JOINT_STATES], pack[BASE_ODOMETRY]
            pack[JOINT_STATES] = lambda stamp: b"".join(part(stamp) for part in parts)
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
            if self._spin is None or not self._spin.find(lambda: self._have(stamp)):
                self._inputs.spin_once(self._executor, _WAIT_S)

    def watch(self, stamp: int) -> None:
        """Take what comes now and then, until every message of a stamp has come."""
        while not self._have(stamp):
            self._executor.spin_once(timeout_sec=_WATCH_S)

    def _have(self, stamp: int) -> bool:
        """Take what has come; return whether every message of a stamp is there."""
        self._inputs.poll()
        return min(self._came.values()) >= stamp

    def _taker(self, topic: str) -> OnSerialized:
        """Return what notes the stamp of a message."""

        def take(data: bytes, sent_ns: int, publisher: bytes) -> None:
            self._came[topic] = stamp_ns(data)

        return take


def _state(variant: str) -> tuple[str, ...]:
    """Return the topics of a state."""
    return (JOINT_STATES,) if variant == ONE else _STATE


def pong(trips: int, variant: str) -> None:
    """Answer the other process."""
    rclpy.init()
    side = Side(CONTROLLER, _COMMAND, _state(variant), variant)
    side.match()
    for trip in range(trips):
        side.wait(trip * _TICK_NS)
        side.send(trip * _TICK_NS)


def watch(trips: int) -> None:
    """Take every message of the two others and do nothing with them."""
    rclpy.init()
    side = Side(RECORDER, (), (*_STATE, *_COMMAND), WATCHED)
    stand_back(_NICENESS)
    side.match()
    side.watch((trips - 1) * _TICK_NS)


def ping(trips: int, variant: str) -> float:
    """Return the mean time in s of a round trip."""
    with reserved_domain(None) as domain, ExitStack() as stack:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        others = []
        for role in ("pong", "watch") if variant == WATCHED else ("pong",):
            command = [sys.executable, "-m", "benchmarks.ping_pong", role, str(trips), variant]
            others.append(stack.enter_context(subprocess.Popen(command, start_new_session=True)))
        rclpy.init()
        side = Side(PLANT, _state(variant), _COMMAND, variant)
        side.match()
        start = perf_counter()
        for trip in range(trips):
            side.send(trip * _TICK_NS)
            side.wait(trip * _TICK_NS)
        elapsed = perf_counter() - start
        for other in others:
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
    role, trips, variant = sys.argv[1], int(sys.argv[2]), "".join(sys.argv[3:])
    if role == "pong":
        pong(trips, variant)
    elif role == "watch":
        watch(trips)
    else:
        print(1e6 * (solo(trips) if role == "solo" else ping(trips, variant)))
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
