"""What the plant applies while no command comes: the last one for a while, then less and less, then none."""

from dataclasses import replace
from enum import Enum

from sms_handover.graph.events import COMMAND_BACK, COMMAND_LOST, TORQUE_ZERO, RunEvent, Severity
from sms_handover.graph.topics import PLANT
from sms_handover.plant.parameters import PlantParameters
from sms_handover.types import JointCommand
from sms_handover.units import ns_to_seconds, seconds_to_ns


class _Supply(Enum):
    """How the joints are supplied with commands."""

    HELD = "held"  # a command that is not older than is tolerated
    RAMPING = "ramping"
    ZERO = "zero"


class CommandWatch:
    """Holds the last command for ``command_hold``, then ramps it to zero over ``command_ramp``.

    With the age a of the last command, the time since the state that it answers, the efforts are those
    of the command times min(1, max(0, 1 - (a - hold) / ramp)). A newer command ends this at once.
    """

    def __init__(self, parameters: PlantParameters) -> None:
        """Begin with a command that is in time."""
        self._hold_ns = seconds_to_ns(parameters.command_hold)
        self._ramp_ns = seconds_to_ns(parameters.command_ramp)
        self.reset()

    def reset(self) -> None:
        """Begin anew."""
        self._supply = _Supply.HELD
        self._oldest_ns = 0

    def look(self, command: JointCommand, stamp_ns: int) -> tuple[JointCommand, RunEvent | None]:
        """Return the command to apply over the tick that begins at a time, and an event on a change."""
        age_ns = stamp_ns - command.stamp_ns
        if age_ns <= self._hold_ns:
            return command, self._change(_Supply.HELD, age_ns, stamp_ns)
        left_ns = self._hold_ns + self._ramp_ns - age_ns
        supply = _Supply.RAMPING if left_ns > 0 else _Supply.ZERO
        share = left_ns / self._ramp_ns if left_ns > 0 else 0.0
        return replace(command, effort=share * command.effort), self._change(supply, age_ns, stamp_ns)

    def _change(self, supply: _Supply, age_ns: int, stamp_ns: int) -> RunEvent | None:
        """Take note of the supply, and return what is to be told of it."""
        before, self._supply = self._supply, supply
        oldest_ns, self._oldest_ns = self._oldest_ns, age_ns
        if supply is before:
            return None
        if supply is _Supply.HELD:
            detail = "joint commands come again"
            return self._event(COMMAND_BACK, Severity.INFO, detail, stamp_ns, oldest_ns)
        if supply is _Supply.RAMPING:
            detail = "no joint command in time; the last torques are ramped to zero"
            return self._event(COMMAND_LOST, Severity.WARNING, detail, stamp_ns, age_ns)
        detail = "no joint command in time; the torques are zero"
        return self._event(TORQUE_ZERO, Severity.ERROR, detail, stamp_ns, age_ns)

    def _event(self, kind: str, severity: Severity, detail: str, stamp_ns: int, age_ns: int) -> RunEvent:
        """Return an event with the age of the command and what is tolerated."""
        hold_s = ns_to_seconds(self._hold_ns)
        return RunEvent(stamp_ns, PLANT, kind, severity, detail, "", ns_to_seconds(age_ns), hold_s, "s")
