"""The joint controller: a joint-space law, its gains phase by phase, and the reference it tracks."""

from dataclasses import dataclass
from typing import Any, Generic

import numpy as np

from sms_handover.control.law import G, JointLaw, LawSetup
from sms_handover.control.protocol import Guidance
from sms_handover.control.reference_track import ReferenceTrack, TrackState
from sms_handover.types import Array, PhaseState, frozen, read_only
from sms_handover.units import ns_to_seconds

Entry = tuple[int, int, PhaseState]  # of a phase: its index, its attempt, whether it is carried out


@dataclass(frozen=True, eq=False)
class JointControllerState:
    """The phase whose gains are in use, the memory of the law, and the reference."""

    entry: Entry
    memory: Array
    track: TrackState


class JointController(Generic[G]):
    """Tracks joint references with a law whose gains change with the phase of the task."""

    def __init__(self, law: JointLaw[G], setup: LawSetup[Any]) -> None:
        self._law = law
        self._gains = setup.gains
        self._dt = ns_to_seconds(setup.tick_ns)
        self._rest = read_only(np.zeros(setup.robot.n_joints))  # N m
        self._track = ReferenceTrack(setup.longest_reference_ns)
        self.reset()

    def reset(self) -> None:
        """Return to the start of a run."""
        self._track.reset()
        self._entry: Entry = (0, 1, PhaseState.ACTIVE)
        self._law.use(self._gains[0])
        self._law.restore(np.zeros(0))

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
        if not self._track.ready:
            return self._rest
        return frozen(self._law.effort(q, v, self._track.at(stamp_ns), self._dt))

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
        return JointControllerState(self._entry, self._law.memory, self._track.state)

    def restore(self, state: JointControllerState) -> None:
        """Go back to a former :attr:`state`."""
        self._entry = state.entry
        self._law.use(self._gains[state.entry[0]])
        self._law.restore(state.memory)
        self._track.restore(state.track)
