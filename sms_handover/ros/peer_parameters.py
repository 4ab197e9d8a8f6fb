"""Asks other nodes for all their parameters, so that a recording can tell what it was made with."""

from collections.abc import Collection, Iterable
from typing import Any

from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient


class PeerParameters:
    """Collects the parameters of some nodes without blocking; call :meth:`poll` until it is done."""

    def __init__(self, node: Node, peers: Collection[str]) -> None:
        """Prepare to ask ``peers``."""
        self._clients = {peer: AsyncParameterClient(node, peer) for peer in peers}
        self._asked: set[str] = set()
        self.values: dict[str, dict[str, object]] = {}

    def ask_again(self) -> None:
        """Forget the answers, for nodes that may have been configured anew."""
        self._asked.clear()
        self.values = {}

    def poll(self) -> bool:
        """Ask every node that has appeared since; tell whether all have answered."""
        for peer, client in self._clients.items():
            if peer not in self._asked and client.services_are_ready():
                self._asked.add(peer)
                client.list_parameters(callback=self._then_get(peer))
        return len(self.values) == len(self._clients)

    def _then_get(self, peer: str) -> Any:
        """Return what to do with the list of a node's parameter names: get the values."""

        def on_names(future: Any) -> None:
            names = sorted(future.result().result.names)
            self._clients[peer].get_parameters(names, callback=self._keep(peer, names))

        return on_names

    def _keep(self, peer: str, names: list[str]) -> Any:
        """Return what to do with a node's parameter values: keep them."""

        def on_values(future: Any) -> None:
            values = [_plain(parameter_value_to_python(value)) for value in future.result().values]
            self.values[peer] = dict(zip(names, values, strict=True))

        return on_values


def _plain(value: object) -> object:
    """Return a parameter value as plain Python, arrays as lists."""
    return list(value) if isinstance(value, Iterable) and not isinstance(value, str | bytes) else value
