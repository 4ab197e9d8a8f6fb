"""Nodes that are told what to do at the wrong moment, wrongly, or twice at once."""

from collections.abc import Callable
from functools import partial
from typing import Any

import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sms_handover_interfaces.srv import StepTicks
from std_srvs.srv import SetBool, Trigger

from sms_handover.graph.topics import CONTROLLER, NODES, PLANT, TRAJECTORY

from ..system.runs import Ended, Running
from .fault import Fault
from .graph_run import bag_of, domain_of, held, same_as_ever, short_run
from .outcome import Kept, require
from .promises import closed, exit_code, one_line, whole
from .trial import Trial

TITLE = "Transitions, pauses and resets"

_BEGUN = (120_000, 400_000)  # [byte] of the bag of a short run: 0.09 MB before it begins, 0.85 MB in all
_PATIENCE_S = 60.0  # [s] of wall time for an answer

Request = tuple[str, Any, dict[str, Any]]  # name and type of a service, and what to ask


class Caller:
    """Calls services of a graph from outside, as `ros2 service call` and `ros2 lifecycle set` do."""

    def __init__(self, run: Running) -> None:
        """Join the domain of a run."""
        rclpy.init(domain_id=domain_of(run), signal_handler_options=SignalHandlerOptions.NO)
        self._node = Node("caller", start_parameter_services=False)
        self._clients: dict[str, Any] = {}

    def find(self, *requests: Request) -> None:
        """Wait for the services of requests."""
        for name, kind, _ in requests:
            if name not in self._clients:
                self._clients[name] = self._node.create_client(kind, name)
            there = self._clients[name].wait_for_service(timeout_sec=_PATIENCE_S)
            require(there, f"there is no service {name}")

    def call(self, *requests: Request) -> list[Any]:
        """Send requests to services that have been found, at once, and return the answers."""
        asked = [self._clients[name].call_async(kind.Request(**values)) for name, kind, values in requests]
        for answer in asked:
            rclpy.spin_until_future_complete(self._node, answer, timeout_sec=_PATIENCE_S)
            require(answer.done(), "a service does not answer")
        return [answer.result() for answer in asked]

    def close(self) -> None:
        """Leave."""
        self._node.destroy_node()
        rclpy.try_shutdown()


def change(node: str, transition: int) -> Request:
    """Return the request for a transition of a node."""
    return f"{node}/change_state", ChangeState, {"transition": Transition(id=transition)}


RESET: Request = (f"{PLANT}/reset", Trigger, {})
FINISH: Request = (f"{PLANT}/finish", Trigger, {})
PAUSE: Request = (f"{PLANT}/pause", SetBool, {"data": True})
RESUME: Request = (f"{PLANT}/pause", SetBool, {"data": False})
STEP: Request = (f"{PLANT}/step", StepTicks, {"ticks": 7})
DEACTIVATE, ACTIVATE = Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_ACTIVATE


def ask(rounds: list[tuple[Request, ...]], trial: Trial) -> tuple[Ended, list[bool]]:
    """Ask a graph something, round by round, at a random moment of the run.

    To find the services can take longer than a short run, so it is held meanwhile, by one node after
    the other: one that stands still cannot be found.
    """
    requests = [request for asked in rounds for request in asked]
    with trial.start(*short_run(trial)) as run:
        caller = Caller(run)
        try:
            run.until_all_nodes(NODES)
            run.until_recorded(bag_of(trial), trial.random.randint(*_BEGUN))
            for holder in (CONTROLLER, TRAJECTORY):
                with held(run, holder):
                    caller.find(*(request for request in requests if not request[0].startswith(holder)))
            agreed = [bool(answer.success) for asked in rounds for answer in caller.call(*asked)]
        finally:
            caller.close()
        return trial.ended(run), agreed


def pause_early(trial: Trial) -> tuple[Ended, list[bool]]:
    """Pause a run that has not begun, as one of its nodes is not ready yet, and resume it."""
    with trial.start(*short_run(trial)) as run:
        caller = Caller(run)
        try:
            run.until_all_nodes(NODES)
            with held(run, CONTROLLER):
                caller.find(PAUSE)
                answers = caller.call(PAUSE)
            require(answers[0].message == "it will start paused", f"the plant says {answers[0].message!r}")
            answers += caller.call(RESUME)
        finally:
            caller.close()
        return trial.ended(run), [bool(answer.success) for answer in answers]


def no_bit_changes(trial: Trial, seen: tuple[Ended, list[bool]]) -> Kept:
    """Require that all was agreed to, and a whole run with the bits of ever."""
    ended, agreed = seen
    require(all(agreed), f"not agreed to: {agreed}")
    return same_as_ever(trial, ended)


def refused_and_no_bit_changes(trial: Trial, seen: tuple[Ended, list[bool]]) -> Kept:
    """Require that nothing was agreed to, and a whole run with the bits of ever."""
    ended, agreed = seen
    require(not any(agreed), f"agreed to: {agreed}")
    return same_as_ever(trial, ended)


def two_runs(trial: Trial, seen: tuple[Ended, list[bool]]) -> Kept:
    """Require two whole bags, both with the bits of ever."""
    ended, agreed = seen
    require(all(agreed), f"not agreed to: {agreed}")
    kept = whole(bag_of(trial), ended)
    bags = sorted(bag.name for bag in bag_of(trial).parent.glob("bag*"))
    require(bags == ["bag", "bag_2"], f"bags {bags}")
    whole(bag_of(trial).with_name("bag_2"), ended)
    again = trial.sms_handover("verify", "run")
    require(again.code == 0, f"a run is not reproduced: {(again.err or again.out)[-300:]}")
    return kept


def ends_whole(trial: Trial, seen: tuple[Ended, list[bool]]) -> Kept:
    """Require a bag that is closed, and an end of the launcher with a reason or in order."""
    ended, _ = seen
    exit_code(ended, 0, 1)
    if ended.code:
        one_line(ended)
    return closed(bag_of(trial), ended)


def _fault(
    name: str,
    injected: str,
    rounds: list[tuple[Request, ...]],
    promise: str,
    check: Callable[[Trial, tuple[Ended, list[bool]]], Kept],
) -> Fault[tuple[Ended, list[bool]]]:
    """Return a fault that asks something of a graph."""
    return Fault(name, injected, promise, partial(ask, rounds), check, seeded=True)


_SAME = "the run goes on and has the bits of ever"
_TWO = "two runs, each with the bits of ever, each in a whole bag of its own"
FAULTS = (
    _fault("reset", "reset at a random tick", [(RESET,)], _TWO, two_runs),
    _fault("reset-twice", "two resets at once at a random tick", [(RESET, RESET)], _TWO, two_runs),
    _fault("reset-paused", "pause, reset, resume", [(PAUSE,), (RESET,), (RESUME,)], _TWO, two_runs),
    _fault("pause-at-once", "paused twice at once", [(PAUSE, PAUSE), (RESUME,)], _SAME, no_bit_changes),
    _fault("steps-at-once", "two steps at once", [(PAUSE,), (STEP, STEP), (RESUME,)], _SAME, no_bit_changes),
    Fault("pause-early", "paused before it begins", _SAME, pause_early, no_bit_changes),
    _fault(
        "plant-inactive",
        "the plant is deactivated at a random tick and activated",
        [(change(PLANT, DEACTIVATE),), (change(PLANT, ACTIVATE),)],
        _SAME,
        no_bit_changes,
    ),
    _fault(
        "controller-inactive",
        "the controller is deactivated at a random tick and activated",
        [(change(CONTROLLER, DEACTIVATE),), (change(CONTROLLER, ACTIVATE),)],
        _SAME,
        no_bit_changes,
    ),
    _fault(
        "trajectory-inactive",
        "the trajectory is deactivated at a random tick and activated",
        [(change(TRAJECTORY, DEACTIVATE),), (change(TRAJECTORY, ACTIVATE),)],
        _SAME,
        no_bit_changes,
    ),
    _fault(
        "wrong-transitions",
        "every node is asked to configure, activate and clean up while it is active",
        [
            tuple(change(node, transition) for node in NODES)
            for transition in (Transition.TRANSITION_CONFIGURE, ACTIVATE, Transition.TRANSITION_CLEANUP)
        ],
        "all are refused; " + _SAME,
        refused_and_no_bit_changes,
    ),
    _fault(
        "plant-shut-down",
        "the plant is shut down at a random tick",
        [(change(PLANT, Transition.TRANSITION_ACTIVE_SHUTDOWN),)],
        "the run ends there, with a closed bag",
        ends_whole,
    ),
    _fault("finish-twice", "two ends at once", [(FINISH, FINISH)], "the bag is closed, whole", ends_whole),
)
