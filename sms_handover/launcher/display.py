"""Display of a run: simulated time, phase, speed and the distances of the tools from their targets."""

from collections.abc import Mapping
from math import hypot, isnan
from time import monotonic

from sms_handover.graph.events import RunEvent
from sms_handover.terminal.progress import Progress
from sms_handover.types import GraspEvent
from sms_handover.units import DEG_PER_RAD, MM_PER_M, ns_to_seconds


class Display(Progress):
    """Shows the progress of a run of known length."""

    def __init__(self, end_ns: int) -> None:
        super().__init__()
        self._end_s = ns_to_seconds(end_ns)
        self._begin, self._begin_s = monotonic(), 0.0

    def lasts_until(self, end_ns: int) -> None:
        """Change the length of the run, as a phase that is repeated makes it longer."""
        self._end_s = ns_to_seconds(end_ns)

    def start(self, stamp_ns: int) -> None:
        """Count wall time from now on, with the run at this simulated time."""
        self._begin, self._begin_s = monotonic(), ns_to_seconds(stamp_ns)

    def finish(self, wall_time: float) -> None:
        """Set how long the whole run has taken, in s of wall time."""
        self._begin, self._begin_s = monotonic() - wall_time, 0.0

    def show_run(
        self,
        stamp_ns: int,
        phase: str = "",
        tool_error: Mapping[str, float] | None = None,
        last: bool = False,
    ) -> None:
        """Show the run at a simulated time, if it is due or the last; ``tool_error`` is in m by arm."""
        if not (last or self.due):
            return
        time_s = ns_to_seconds(stamp_ns)
        factor = (time_s - self._begin_s) / max(monotonic() - self._begin, 1e-9)
        errors = [f"{arm} {error * MM_PER_M:.2f} mm" for arm, error in sorted((tool_error or {}).items())]
        self.show(
            f"{time_s:6.2f} of {self._end_s:g} s  {phase}".rstrip(),
            "  ".join([f"{factor:.2f} x real time", *errors]),
            min(time_s / self._end_s, 1.0) if self._end_s else 1.0,
        )
        if last:
            self.stay()

    def print_event(self, event: GraspEvent | RunEvent) -> None:
        """Print an event in a line of its own."""
        self.print(grasp_line(event) if isinstance(event, GraspEvent) else str(event))


def grasp_line(event: GraspEvent) -> str:
    """Return a grasp event in words, with the errors of the tool against the grasp frame where it has any."""
    command = event.command
    time_s = ns_to_seconds(event.stamp_ns)
    text = f"{time_s:6.2f} s  {command.action.value} by {command.arm}: {event.status.value}"
    if not isnan(event.position_error):
        text += (
            f", {event.position_error * MM_PER_M:.3f} mm, {event.angle_error * DEG_PER_RAD:.3f} deg, "
            f"{event.relative_speed * MM_PER_M:.3f} mm/s off"
        )
    if any(event.impulse):
        text += f", impulse {hypot(*event.impulse[:3]):.3g} N s, {event.energy_lost:.3g} J lost"
    return f"{text} ({event.detail})" if event.detail else text
