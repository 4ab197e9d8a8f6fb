"""Simulate a scenario in one process: the same objects as in the graph, joined by plain calls."""

from collections.abc import Callable, Sequence

from sms_handover.control.protocol import Controller
from sms_handover.errors import NoPlanError
from sms_handover.run_data import RunData
from sms_handover.simulation.loop import Loop
from sms_handover.simulation.observed_ticks import Ticks
from sms_handover.simulation.quiet_periods import QuietPeriods
from sms_handover.simulation.recorder import RunRecorder
from sms_handover.simulation.scenario import Scenario
from sms_handover.types import BaseWrench, TaskPhase

Progress = Callable[[int, TaskPhase], None]
Until = Callable[[Ticks | QuietPeriods], bool]


class RunWithoutPlanError(NoPlanError):
    """A run has ended at rest because its law finds no plan; ``run`` is what there is up to there."""

    def __init__(self, message: str, run: RunData) -> None:
        """Take what the law says, and the run."""
        super().__init__(message)
        self.run = run


def simulate(
    scenario: Scenario | None = None,
    *,
    controller: Controller | None = None,
    progress: Progress | None = None,
    base_wrenches: Sequence[BaseWrench] = (),
    until: Until | None = None,
) -> RunData:
    """Return the run of a scenario, by default the shipped one.

    ``controller`` replaces that of the scenario and is reset first. ``progress`` is called each reference
    period with the time in ns and the phase. ``base_wrenches`` act as if they had come by topic
    ``base_wrench``. ``until`` is given what was carried out, and returns whether the run ends with that; it
    may be several reference periods. Raises what :class:`~sms_handover.simulation.loop.Loop` and
    :func:`run_of` do.
    """
    return run_of(Loop(scenario, controller, base_wrenches), progress=progress, until=until)


def run_of(loop: Loop, *, progress: Progress | None = None, until: Until | None = None) -> RunData:
    """Return the run of a loop from where it is; ``progress`` and ``until`` are those of :func:`simulate`.

    Raises RunWithoutPlanError with the run up to there if a law finds no plan again and again, and
    NoPlanError if it does from the first period on.
    """
    robot = loop.scenario.model.robot
    panels = tuple(panel.joint for panel in loop.scenario.truth.robot.description.flexible_panels)
    recorder, is_empty = RunRecorder(robot.joint_names, robot.arms, loop.last_tick + 1, panels), True
    while not loop.finished:
        try:
            ticks = loop.advance_quietly(recorder.room)
        except NoPlanError as error:
            if is_empty:
                raise
            raise RunWithoutPlanError(str(error), recorder.data(loop.base_wrenches, loop.applied)) from error
        recorder.add(ticks)
        is_empty = False
        if progress:
            for phase in ticks.phases:
                progress(phase.stamp_ns, phase)
        if until and until(ticks):
            break
    return recorder.data(loop.base_wrenches, loop.applied)
