"""Peer parameters: all parameters of other nodes, so that a recording has what it was made with."""

from collections.abc import Collection, Iterable
from functools import partial
from time import monotonic
from typing import Any

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python

_ASK_AGAIN_S = 2.0  # [s] of wall time; many times what an answer takes


class PeerParameters:
    """Collects the parameters of some nodes without blocking; call :meth:`poll` until it is done.

    A response may be lost: a service drops it if it has not found the client's reader, though the client has
    found the service. So a node that is silent is asked again. rclpy's ``AsyncParameterClient`` makes six
    clients per node, of which two are needed; five nodes' take a tenth of a second at the start.
    """

    def __init__(self, node: Node, peers: Collection[str], ask_again_s: float = _ASK_AGAIN_S) -> None:
        self._lists = {peer: node.create_client(ListParameters, f"{peer}/list_parameters") for peer in peers}
        self._values = {peer: node.create_client(GetParameters, f"{peer}/get_parameters") for peer in peers}
        self._ask_again_s = ask_again_s
        self._asked_at: dict[str, float] = {}
        self.values: dict[str, dict[str, object]] = {}

    def ask_again(self) -> None:
        """Forget the answers, of nodes that may have been configured again."""
        self._asked_at.clear()
        self.values = {}

    def poll(self) -> bool:
        """Ask every node that has appeared since or has not answered; return whether all have answered."""
        now = monotonic()
        for peer in self._lists.keys() - self.values.keys():
            due = peer not in self._asked_at or now - self._asked_at[peer] > self._ask_again_s
            if due and self._lists[peer].service_is_ready() and self._values[peer].service_is_ready():
                self._asked_at[peer] = now
                answer = self._lists[peer].call_async(ListParameters.Request())
                answer.add_done_callback(partial(self._on_names, peer))
        return len(self.values) == len(self._lists)

    def _on_names(self, peer: str, future: Any) -> None:
        names = sorted(future.result().result.names)
        answer = self._values[peer].call_async(GetParameters.Request(names=names))
        answer.add_done_callback(partial(self._on_values, peer, names))

    def _on_values(self, peer: str, names: list[str], future: Any) -> None:
        values = [_plain(parameter_value_to_python(value)) for value in future.result().values]
        self.values[peer] = dict(zip(names, values, strict=True))


def _plain(value: object) -> object:
    """Return a parameter value as plain Python, arrays as lists."""
    return list(value) if isinstance(value, Iterable) and not isinstance(value, str | bytes) else value
