"""A bench for nodes: parameters in, any nodes in one process, one executor, waiting on conditions."""

from collections.abc import Callable, Mapping
from pathlib import Path
from time import monotonic
from typing import Any, TypeVar

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from sms_handover.ros.node.graph_node import GraphNode
from sms_handover.ros.parameters import as_arguments
from sms_handover.ros.transport.inputs import Inputs

N = TypeVar("N", bound=Node)

DEADLINE_S = 60.0  # s of wall time after which a test that waits has failed; nothing is measured by it

_LOOK_S = 0.001  # s of wall time between two looks at the inputs of loops

Parameters = Mapping[str, Mapping[str, object]]


class LoopsExecutor:
    """An executor of several nodes that looks after the inputs of their loops too."""

    def __init__(self) -> None:
        """Begin without any node."""
        self._executor = EventsExecutor()
        self._inputs: list[Inputs] = []

    def add_node(self, node: Node) -> None:
        """Spin a node from now on."""
        self._executor.add_node(node)
        if isinstance(node, GraphNode):
            self._inputs += [node.inputs.loop, node.inputs.news]

    def spin_once(self, timeout_sec: float) -> None:
        """Handle what has come; where nothing has, wait a little."""
        found = sum(inputs.poll() for inputs in self._inputs)
        wait_s = min(timeout_sec, _LOOK_S) if self._inputs else timeout_sec
        self._executor.spin_once(timeout_sec=0.0 if found else wait_s)


class Bench:
    """One ROS context of an own domain; leaving it destroys every node that was made in it."""

    def __init__(self, domain: int, folder: Path) -> None:
        """Prepare; ROS is not started before :meth:`start`."""
        self.folder = folder
        self._domain = domain
        self._nodes: list[Node] = []
        self._executor: LoopsExecutor | None = None

    def start(self, parameters: Parameters | None = None) -> None:
        """Start ROS with parameters by node name, where ``common`` is for all nodes."""
        arguments = ["--ros-args"]
        for node, values in (parameters or {}).items():
            prefix = "" if node == "common" else f"{node}:"
            for name, value in values.items():
                flag, assignment = as_arguments({name: value})
                arguments += [flag, prefix + assignment]
        rclpy.init(args=arguments, domain_id=self._domain, signal_handler_options=SignalHandlerOptions.NO)

    def add(self, make: Callable[[], N]) -> N:
        """Return the node that ``make`` returns, spun with the others from now on."""
        node = make()
        self._nodes.append(node)
        if isinstance(node, GraphNode):
            node.start()
        self.spin(node)
        return node

    def later(self, make: Callable[[], N]) -> N:
        """Return the node that ``make`` returns, which is neither started nor spun."""
        node = make()
        self._nodes.append(node)
        return node

    def loose(self, name: str) -> Node:
        """Return a node with nothing in it that is not spun before :meth:`spin`."""
        node = Node(name, start_parameter_services=False)
        self._nodes.append(node)
        return node

    def spin(self, node: Node) -> None:
        """Spin a node with the others from now on."""
        self.executor.add_node(node)

    def plain(self, name: str) -> Node:
        """Return a node with nothing in it."""
        return self.add(lambda: Node(name, start_parameter_services=False))

    @property
    def executor(self) -> Any:
        """Return the executor of all nodes."""
        if self._executor is None:
            self._executor = LoopsExecutor()
        return self._executor

    def until(self, condition: Callable[[], object], what: str) -> None:
        """Handle events until a condition holds; fail, saying ``what`` was waited for, if it never does."""
        deadline = monotonic() + DEADLINE_S
        while not condition():
            assert monotonic() < deadline, f"waited in vain for {what}"
            self.executor.spin_once(timeout_sec=0.05)

    def result(self, future: Any, what: str = "an answer") -> Any:
        """Return what a future gives."""
        self.until(future.done, what)
        return future.result()

    def close(self) -> None:
        """Destroy the nodes and end ROS."""
        for node in self._nodes:
            node.destroy_node()
        self._nodes.clear()
        self._executor = None
        rclpy.try_shutdown()
