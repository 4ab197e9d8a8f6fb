"""The joint controller: a joint-space law, its gains phase by phase, and the reference it tracks."""

from dataclasses import dataclass
from typing import Any, Generic

import numpy as np

from sms_handover.control.law import G, JointLaw, LawSetup
from sms_handover.control.protocol import Guidance
from sms_handover.control.reference_track import ReferenceTrack, TrackState
from sms_handover.model.known_payload import EMPTY_HANDS, Grip, KnownPayload
from sms_handover.model.robot_model import RobotModel
from sms_handover.types import Array, GraspEvent, PhaseState, frozen, read_only
from sms_handover.units import ns_to_seconds

Entry = tuple[int, int, PhaseState]  # of a phase: its index, its attempt, whether it is carried out


@dataclass(frozen=True, eq=False)
class JointControllerState:
    """The phase whose gains are in use, the memory of the law, the reference, and who holds the deputy.

    ``news`` are events that hold from the next state on.
    """

    entry: Entry
    memory: Array
    track: TrackState
    grip: Grip = EMPTY_HANDS
    news: tuple[GraspEvent, ...] = ()


class JointController(Generic[G]):
    """Tracks joint references with a law whose gains change with the phase of the task."""

    def __init__(self, law: JointLaw[G], setup: LawSetup[Any]) -> None:
        self._law = law
        self._gains = setup.gains
        self._dt = ns_to_seconds(setup.tick_ns)
        self._rest = read_only(np.zeros(setup.robot.n_joints))  # N m
        self._track = ReferenceTrack(setup.longest_reference_ns)
        self._payload = KnownPayload(setup.robot, setup.deputy)
        self.reset()

    def reset(self) -> None:
        """Return to the start of a run."""
        self._track.reset()
        self._entry: Entry = (0, 1, PhaseState.ACTIVE)
        self._law.use(self._gains[0])
        self._law.restore(np.zeros(0))
        self._news: tuple[GraspEvent, ...] = ()
        if self._payload.has_mass:
            self._hold(EMPTY_HANDS)

    def guide(self, guidance: Guidance) -> None:
        """Track the joint reference, with the gains of the phase where it begins, is repeated or fails."""
        phase = guidance.phase
        if phase.entry != self._entry:
            self._entry = phase.entry
            self._law.use(self._gains[phase.index])
            self._track.restart()
        self._track.update(guidance.reference)

    def effort(self, stamp_ns: int, q: Array, v: Array) -> Array:
        """Return the efforts (n,) N m for a state, read-only; zero until a first reference has come."""
        if self._news:
            self.heed_news(stamp_ns)
        if not self._track.ready:
            return self._rest
        return frozen(self._law.effort(q, v, self._track.at(stamp_ns), self._dt))

    def grasped(self, event: GraspEvent) -> None:
        """Learn what came of a grasp command; its payload counts from the next state on."""
        if self._payload.has_mass:
            self._news = (*self._news, event)

    @property
    def robot(self) -> RobotModel:
        """The robot with its payload, as it is known."""
        return self._payload.robot

    @property
    def has_news(self) -> bool:
        """Whether the payload may be another one from the next state on."""
        return bool(self._news)

    def heed_news(self, stamp_ns: int) -> None:
        """Take up the payload of the latest events, if a state comes after them."""
        due = [event for event in self._news if event.stamp_ns < stamp_ns]
        if not due:
            return
        self._news = self._news[len(due) :]
        if any([self._payload.grasped(event) for event in due]):
            self._law.carry(self._payload.robot)

    def _hold(self, grip: Grip) -> None:
        """Go on with who holds the deputy."""
        self._payload.hold(grip)
        self._law.carry(self._payload.robot)

    @property
    def law(self) -> JointLaw[G]:
        """The law."""
        return self._law

    @property
    def track(self) -> ReferenceTrack:
        """The reference that is tracked."""
        return self._track

    @property
    def state(self) -> JointControllerState:
        """Everything that later efforts depend on."""
        track, grip = self._track.state, self._payload.grip
        return JointControllerState(self._entry, self._law.memory, track, grip, self._news)

    def restore(self, state: JointControllerState) -> None:
        """Go back to a former :attr:`state`."""
        self._entry = state.entry
        self._law.use(self._gains[state.entry[0]])
        self._track.restore(state.track)
        self._news = state.news
        if self._payload.has_mass:
            self._hold(state.grip)
        self._law.restore(state.memory)
