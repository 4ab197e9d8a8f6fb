"""Lifecycle driver: takes all nodes of a graph through their lifecycle, one state after the other."""

from collections.abc import Collection
from functools import partial
from time import monotonic
from typing import Any

from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.node import Node

_CONFIGURE, _ACTIVATE = Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE
_SHUTDOWN = Transition.TRANSITION_ACTIVE_SHUTDOWN
_DOES = {_CONFIGURE: "configured", _ACTIVATE: "activated", _SHUTDOWN: "shut down"}
# The states before and after a transition; any other is one between.
_BEFORE = {_CONFIGURE: State.PRIMARY_STATE_UNCONFIGURED, _ACTIVATE: State.PRIMARY_STATE_INACTIVE}
_AFTER = {_CONFIGURE: State.PRIMARY_STATE_INACTIVE, _ACTIVATE: State.PRIMARY_STATE_ACTIVE}

_ANSWER_TIMEOUT_S = 2.0  # [s] of wall time without an answer after which a node is asked for its state


class LifecycleDriver:
    """Configures every node, then activates every node, and in the end shuts them down.

    Nothing blocks: :meth:`poll` does what is due, and answers arrive through the executor of the node. A
    node that fails in a transition reports why itself, and ends. The first answer of a service is lost if
    its node has not discovered the client within 100 ms (rmw_fastrtps); so a node that does not answer is
    asked for its state, and for the transition again if it has not made it.
    """

    def __init__(self, node: Node, names: Collection[str]) -> None:
        self._clients = {name: node.create_client(ChangeState, f"{name}/change_state") for name in names}
        self._states = {name: node.create_client(GetState, f"{name}/get_state") for name in names}
        self._done: dict[int, set[str]] = {transition: set() for transition in _DOES}
        self._asked_at: dict[tuple[int, str], float] = {}  # [s] of wall time
        self._failed: dict[str, str] = {}

    @property
    def active(self) -> bool:
        """Whether every node has been activated."""
        return self._have_all(_ACTIVATE)

    @property
    def waiting_for(self) -> str:
        """Which nodes are not active yet, and what is waited for, in words; "" for none."""
        if self._failed:
            return "; ".join(self._failed.values())
        transition = _ACTIVATE if self._have_all(_CONFIGURE) else _CONFIGURE
        missing = sorted(self._clients.keys() - self._done[transition])
        return f"{', '.join(missing)} to be {_DOES[transition]}" if missing else ""

    def poll(self) -> None:
        """Ask for the transitions that are due towards the state ``active``."""
        if self.active:
            return
        transition = _ACTIVATE if self._have_all(_CONFIGURE) else _CONFIGURE
        self._ask(transition)
        self._ask_again(transition)

    def shut_down(self) -> None:
        """Ask every node that still runs to shut down, so that its process ends."""
        self._ask(_SHUTDOWN)

    def _have_all(self, transition: int) -> bool:
        return self._done[transition] >= self._clients.keys()

    def _ask(self, transition: int) -> None:
        """Ask every node that is there for a transition, once."""
        for name, client in self._clients.items():
            if (transition, name) not in self._asked_at and client.service_is_ready():
                self._asked_at[transition, name] = monotonic()
                request = ChangeState.Request(transition=Transition(id=transition))
                client.call_async(request).add_done_callback(partial(self._on_answer, name, transition))

    def _ask_again(self, transition: int) -> None:
        """Ask nodes that have not answered for a while for their state."""
        now = monotonic()
        for name in self._clients.keys() - self._done[transition]:
            client, asked_at = self._states[name], self._asked_at.get((transition, name), now)
            if now - asked_at > _ANSWER_TIMEOUT_S and client.service_is_ready():
                self._asked_at[transition, name] = now
                client.call_async(GetState.Request()).add_done_callback(
                    partial(self._on_state, name, transition)
                )

    def _on_answer(self, name: str, transition: int, future: Any) -> None:
        if future.result().success:
            self._done[transition].add(name)
        elif name not in self._done[transition]:
            self._failed[name] = f"{name} could not be {_DOES[transition]}"

    def _on_state(self, name: str, transition: int, future: Any) -> None:
        state = future.result().current_state.id
        if state == _AFTER[transition]:
            self._done[transition].add(name)
        elif state == _BEFORE[transition] and name not in self._done[transition]:
            self._asked_at.pop((transition, name), None)  # the request was lost
