"""How far a run is, on a terminal in one line that is written over, else a line now and then."""

from collections.abc import Mapping
from time import monotonic

from sms_handover.graph.events import RunEvent
from sms_handover.terminal.status_line import StatusLine
from sms_handover.types import GraspEvent
from sms_handover.units import DEG_PER_RAD, MM_PER_M, ns_to_seconds


class Display:
    """Shows the progress of a run of known length on standard error."""

    def __init__(self, end_ns: int) -> None:
        """Begin to count wall time."""
        self._end_s = ns_to_seconds(end_ns)
        self._begin, self._begin_s = monotonic(), 0.0
        self._line = StatusLine()

    def lasts_until(self, end_ns: int) -> None:
        """Take another length of the run, as a phase done again makes it longer."""
        self._end_s = ns_to_seconds(end_ns)

    def start(self, stamp_ns: int) -> None:
        """Count wall time from now on, with the run at this simulated time."""
        self._begin, self._begin_s = monotonic(), ns_to_seconds(stamp_ns)

    def finish(self, wall_time: float) -> None:
        """Let the whole run have taken so many s of wall time, as whoever ran it has measured."""
        self._begin, self._begin_s = monotonic() - wall_time, 0.0

    def show(self, stamp_ns: int, phase: str, tool_error: Mapping[str, float], *, last: bool = False) -> None:
        """Show simulated time, phase, real-time factor and the tools' distance to their targets in mm."""
        if not last and not self._line.due:
            return
        time_s = ns_to_seconds(stamp_ns)
        factor = (time_s - self._begin_s) / max(monotonic() - self._begin, 1e-9)
        errors = "  ".join(f"{arm} {error * MM_PER_M:7.2f} mm" for arm, error in sorted(tool_error.items()))
        self._line.show(
            f"{time_s:6.2f} of {self._end_s:g} s  {phase:<12}  {factor:4.2f} x real time  {errors}"
        )
        if last:
            self._line.stay()

    def event(self, event: GraspEvent | RunEvent) -> None:
        """Show an event in a line of its own."""
        self.tell(grasp_line(event) if isinstance(event, GraspEvent) else str(event))

    def tell(self, text: str) -> None:
        """Show a text in a line of its own."""
        self._line.show(text)
        self._line.stay()


def grasp_line(event: GraspEvent) -> str:
    """Return a grasp event in words, with the errors that the tool had against the grasp frame."""
    command = event.command
    time_s = ns_to_seconds(event.stamp_ns)
    text = f"{time_s:6.2f} s  {command.action.value} by {command.arm}: {event.status.value}"
    if event.position_error == event.position_error:  # NaN where it does not apply
        text += (
            f", {event.position_error * MM_PER_M:.3f} mm, {event.angle_error * DEG_PER_RAD:.3f} deg, "
            f"{event.relative_speed * MM_PER_M:.3f} mm/s off"
        )
    return f"{text} ({event.detail})" if event.detail else text
