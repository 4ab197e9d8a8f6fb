"""Plan events: what is told of solves that gave no plan, once when that begins and once when it is over."""

from sms_handover.graph.events import PLAN_BACK, PLAN_FAILED, RunEvent, Severity
from sms_handover.graph.topics import CONTROLLER
from sms_handover.plan_report import PlanReport, PlanStatus


class PlanEvents:
    """Compares the report of each solve with that of the solve before."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Return to the start of a run."""
        self.restore(PlanStatus.SOLVED)

    @property
    def state(self) -> PlanStatus:
        """What later events depend on: what came of the latest solve."""
        return self._status

    def restore(self, state: PlanStatus) -> None:
        """Go back to a former :attr:`state`."""
        self._status = state

    def of(self, report: PlanReport, trouble: str = "") -> tuple[RunEvent, ...]:
        """Return the event of a report, if it is of another kind than the one before.

        ``trouble`` is how the process of the solver has ended, '' while it runs or is this one.
        """
        before, self._status = self._status, report.status
        if report.status is before:
            return ()
        if report.status is PlanStatus.SOLVED:
            detail = "there is a plan again"
            return (RunEvent(report.stamp_ns, CONTROLLER, PLAN_BACK, Severity.INFO, detail),)
        row = report.largest_slack_row
        detail = f"{report.status.value}; {row} would have to be exceeded" if row else report.status.value
        detail += f"; {trouble}" if trouble else ""
        braking = report.status is PlanStatus.BRAKING
        severity = Severity.ERROR if braking else Severity.WARNING
        return (RunEvent(report.stamp_ns, CONTROLLER, PLAN_FAILED, severity, detail),)
