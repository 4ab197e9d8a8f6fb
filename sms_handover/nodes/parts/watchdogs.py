"""Watchdogs: they report an input that stops coming, and that it comes again."""

from dataclasses import dataclass, replace

from sms_handover.graph.events import (
    COMMAND_BACK,
    COMMAND_LOST,
    NO_ANSWER,
    REFERENCE_BACK,
    REFERENCE_LOST,
    RESYNCHRONISED,
    TORQUE_ZERO,
    RunEvent,
    Severity,
)
from sms_handover.graph.topics import CONTROLLER, PLANT
from sms_handover.plant.parameters import PlantParameters
from sms_handover.types import JointCommand
from sms_handover.units import ns_to_seconds, seconds_to_ns


@dataclass(frozen=True)
class Alarm:
    """What is reported when an input reaches a level; ``detail`` may have fields in braces."""

    kind: str
    severity: Severity
    detail: str


class StreamWatchdog:
    """Reports each change of the level of one input: 0 while it comes in time, more the longer it does not.

    An event has the age of the latest input, at level 0 the age that it had reached, and ``limit_s``.
    """

    def __init__(self, node: str, limit_s: float, *alarms: Alarm | None, unit: str = "s") -> None:
        """Report for a node, by one alarm for each level; None where a level is not worth an event."""
        self._node, self._limit_s, self._alarms, self._unit = node, limit_s, alarms, unit
        self.reset()

    def reset(self) -> None:
        """Begin with an input that is in time."""
        self._level, self._age_s = 0, 0.0

    def update(self, level: int, age_s: float, stamp_ns: int, **fields: str) -> RunEvent | None:
        """Return an event if the level has changed; ``fields`` are those of its detail."""
        change, alarm = level != self._level, self._alarms[level]
        value = age_s if level else self._age_s
        self._level, self._age_s = level, age_s
        if alarm is None or not change:
            return None
        detail = alarm.detail.format(**fields)
        return RunEvent(
            stamp_ns, self._node, alarm.kind, alarm.severity, detail, "", value, self._limit_s, self._unit
        )


class ReferenceWatchdog(StreamWatchdog):
    """Watches the age of the latest joint reference in the controller."""

    def __init__(self, longest_ns: int) -> None:
        lost = "no joint reference in time; the desired joints stand still where the last one led"
        super().__init__(
            CONTROLLER,
            ns_to_seconds(longest_ns),
            Alarm(REFERENCE_BACK, Severity.INFO, "joint references come again"),
            Alarm(REFERENCE_LOST, Severity.WARNING, lost),
        )
        self._longest_ns = longest_ns

    def poll(self, reference_ns: int, stamp_ns: int) -> RunEvent | None:
        """Return an event if the latest reference has become too old, or is in time again."""
        age_ns = stamp_ns - reference_ns
        return self.update(int(age_ns > self._longest_ns), ns_to_seconds(age_ns), stamp_ns)


class AnswerWatchdog(StreamWatchdog):
    """Watches for how long a state has had no answer in lock step; an ``answer_timeout`` of 0 never ends."""

    def __init__(self, parameters: PlantParameters) -> None:
        detail = "nothing has come on {awaited} for the state of {state} s"
        self._timeout_s = parameters.answer_timeout
        self._stamp_ns: int | None = None
        self._since_s = 0.0
        alarm = Alarm(NO_ANSWER, Severity.ERROR, detail)
        super().__init__(PLANT, self._timeout_s, None, alarm, unit="s of wall time")

    def poll(self, stamp_ns: int | None, awaited: str, now_s: float) -> RunEvent | None:
        """Return an event if the state of a stamp has waited for the input ``awaited`` for too long.

        ``stamp_ns`` is None while the loop is not meant to go on; ``now_s`` is wall time.
        """
        if stamp_ns is None or stamp_ns != self._stamp_ns:
            self._stamp_ns, self._since_s = stamp_ns, now_s
            self.reset()
            return None
        silent_s = now_s - self._since_s
        late = 0.0 < self._timeout_s <= silent_s
        return self.update(late, silent_s, stamp_ns, awaited=awaited, state=f"{ns_to_seconds(stamp_ns):g}")


class CommandWatchdog(StreamWatchdog):
    """Holds the last command for ``command_hold``, then ramps it to zero over ``command_ramp``.

    With the age a of the last command, the time since the state that it answers, the efforts are those
    of the command times min(1, max(0, 1 - (a - hold) / ramp)). A newer command ends this at once.
    """

    def __init__(self, parameters: PlantParameters) -> None:
        super().__init__(
            PLANT,
            parameters.command_hold,
            Alarm(COMMAND_BACK, Severity.INFO, "joint commands come again"),
            Alarm(
                COMMAND_LOST,
                Severity.WARNING,
                "no joint command in time; the last torques are ramped to zero",
            ),
            Alarm(TORQUE_ZERO, Severity.ERROR, "no joint command in time; the torques are zero"),
        )
        self._hold_ns = seconds_to_ns(parameters.command_hold)
        self._ramp_ns = seconds_to_ns(parameters.command_ramp)

    def poll(self, command: JointCommand, stamp_ns: int) -> tuple[JointCommand, RunEvent | None]:
        """Return the command to apply over the tick that begins at a time, and an event on a change."""
        age_ns = stamp_ns - command.stamp_ns
        left_ns = self._hold_ns + self._ramp_ns - age_ns
        level = 0 if age_ns <= self._hold_ns else 1 if left_ns > 0 else 2
        if level:
            share = left_ns / self._ramp_ns if level == 1 else 0.0
            command = replace(command, effort=share * command.effort)
        return command, self.update(level, ns_to_seconds(age_ns), stamp_ns)


def lag_skipped(stamp_ns: int, skipped_s: float, catch_up_s: float) -> RunEvent:
    """Return the event of a plant that has skipped a lag behind the wall clock."""
    detail = "the plant was too far behind the wall clock; simulated time stays behind by as much"
    return RunEvent(
        stamp_ns, PLANT, RESYNCHRONISED, Severity.WARNING, detail, "", skipped_s, catch_up_s, "s of wall time"
    )
