"""Takes the nodes of a graph through their lifecycle, all of them one state after the other."""

from collections.abc import Collection
from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.node import Node

_CONFIGURE, _ACTIVATE = Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE
_SHUTDOWN = Transition.TRANSITION_ACTIVE_SHUTDOWN
_DOES = {_CONFIGURE: "configured", _ACTIVATE: "activated", _SHUTDOWN: "shut down"}


class LifecycleDriver:
    """Configures every node, then activates every node, and in the end shuts them down.

    Nothing blocks: :meth:`look` does what is due, and answers come by the executor of the node. A node
    that fails in a transition tells why itself, and ends.
    """

    def __init__(self, node: Node, names: Collection[str]) -> None:
        """Prepare to drive the nodes of these names."""
        self._clients = {name: node.create_client(ChangeState, f"{name}/change_state") for name in names}
        self._done: dict[int, set[str]] = {transition: set() for transition in _DOES}
        self._asked: dict[int, set[str]] = {transition: set() for transition in _DOES}
        self._failed: dict[str, str] = {}

    @property
    def active(self) -> bool:
        """Tell whether every node has been activated."""
        return self._have_all(_ACTIVATE)

    @property
    def waiting_for(self) -> str:
        """Return in words which nodes are not active yet, and what of them is waited for; "" for none."""
        if self._failed:
            return "; ".join(self._failed.values())
        transition = _ACTIVATE if self._have_all(_CONFIGURE) else _CONFIGURE
        missing = sorted(self._clients.keys() - self._done[transition])
        return f"{', '.join(missing)} to be {_DOES[transition]}" if missing else ""

    def look(self) -> None:
        """Ask for the transitions that are due towards the state ``active``."""
        if not self._have_all(_CONFIGURE):
            self._ask(_CONFIGURE)
        elif not self.active:
            self._ask(_ACTIVATE)

    def shut_down(self) -> None:
        """Ask every node to shut down, so that its process ends; those that are gone are left alone."""
        self._ask(_SHUTDOWN)

    def _have_all(self, transition: int) -> bool:
        """Tell whether every node has done a transition."""
        return self._done[transition] >= self._clients.keys()

    def _ask(self, transition: int) -> None:
        """Ask every node that is there for a transition, once."""
        for name, client in self._clients.items():
            if name not in self._asked[transition] and client.service_is_ready():
                self._asked[transition].add(name)
                request = ChangeState.Request(transition=Transition(id=transition))
                client.call_async(request).add_done_callback(self._keep(name, transition))

    def _keep(self, name: str, transition: int) -> Any:
        """Return what takes the answer of a node."""

        def on_answer(future: Any) -> None:
            if future.result().success:
                self._done[transition].add(name)
            else:
                self._failed[name] = f"{name} could not be {_DOES[transition]}"

        return on_answer
