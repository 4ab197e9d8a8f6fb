"""Case of a campaign: one run as a pure function of campaign, case, scenario and law."""

import platform
import re
import time
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from sms_handover.analysis.equality import run_digest
from sms_handover.analysis.plan_use import plan_use
from sms_handover.campaign.cases.case_metrics import known_metrics, metrics_of
from sms_handover.campaign.cases.case_row import Beside, Row, Status, Task
from sms_handover.campaign.cases.read_back import is_exact, is_same, read_back
from sms_handover.campaign.definition.campaign_file import Campaign
from sms_handover.campaign.definition.distributions import Value
from sms_handover.campaign.definition.frozen import Frozen
from sms_handover.campaign.definition.named_files import is_file_path, located
from sms_handover.campaign.sampling.samples import Samples
from sms_handover.campaign.sampling.streams import run_seed
from sms_handover.errors import ConfigurationError, ControllerError, NoPlanError, SmsHandoverError
from sms_handover.run_data import RunData
from sms_handover.simulation.loop import Loop
from sms_handover.simulation.observed_ticks import Ticks
from sms_handover.simulation.quiet_periods import QuietPeriods
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.simulate import RunWithoutPlanError, run_of
from sms_handover.types import Array

_ONE_LINE = 300  # [characters] of a cause
_COMPLETE = "complete"  # the metric for which a run must lack nothing
_ADDRESS = re.compile(r" ?\b(at )?0x[0-9a-fA-F]{6,}")


class _OverriddenDrawError(SmsHandoverError):
    """A drawn value is not what plant or model have."""


@dataclass(frozen=True, eq=False)
class CaseResult:
    """The row of a case, what was measured beside it, and its run, which ends where there is no plan."""

    row: Row
    beside: Beside
    run: RunData | None = None


class Cases:
    """The cases of a campaign, each of which can be run any time, in any order, with the same result."""

    def __init__(self, frozen: Frozen, cases: int | None, folder: Path) -> None:
        """Unpack the campaign below a folder of ours; raises ConfigurationError."""
        self.campaign: Campaign = frozen.unpacked(folder, cases)
        self.samples = Samples(self.campaign)
        self._folder = folder

    def values(self, task: Task) -> dict[str, object]:
        """Return all values that a run has on top of its scenario, by dotted path."""
        campaign = self.campaign
        seed = {"seed": run_seed(campaign.seed, task.case)}
        own = campaign.scenarios[task.scenario].values
        given = located({**campaign.values, **own, **self.samples.inputs(task.case)}, self._folder)
        return {**seed, **given, "law": task.law}

    def scenario(self, task: Task) -> Scenario:
        """Return the scenario of a run with its values; raises ConfigurationError."""
        source = self.campaign.scenarios[task.scenario].source
        return load_scenario(self._folder / source, self.values(task))

    def read_inputs(self, loop: Loop, case: int, inputs: dict[str, Value]) -> None:
        """Fill in the drawn values of a case as plant and model have them, files by the names in the draw.

        Raises ConfigurationError on one that cannot be read back, SmsHandoverError on one that is not there.
        """
        drawn = self.samples.inputs(case)
        for path, asked in located(drawn, self._folder).items():
            found = read_back(loop, path)
            inputs[path] = drawn[path] if is_file_path(path) and found == asked else found
            if is_exact(loop, path) and not is_same(asked, found):
                raise _OverriddenDrawError(
                    f"{path} was drawn as {asked}, and is {found}: another draw or value sets the same"
                )

    def _in_one_line(self, cause: str) -> str:
        """Return a cause without what depends on the process: our folder, and addresses in memory."""
        for folder in (self._folder.resolve(), self._folder):
            cause = cause.replace(f"{folder}/", "")
        return " ".join(_ADDRESS.sub("", cause).split())[:_ONE_LINE]

    def run(self, task: Task) -> CaseResult:
        """Return what comes of a case; never raises because of it."""
        wall, cpu = time.monotonic(), time.process_time()
        seed = run_seed(self.campaign.seed, task.case)
        inputs: dict[str, Value] = {}
        metrics: dict[str, float | None] = {}
        run: RunData | None = None
        try:
            status, cause, run = self._run(task, inputs, metrics)
        except ConfigurationError as error:
            status, cause = Status.REJECTED, str(error)
        except (ControllerError, FloatingPointError, OverflowError, np.linalg.LinAlgError) as error:
            status, cause = Status.NUMERIC_FAILURE, f"{type(error).__name__}: {error}"
        except MemoryError:
            status, cause = Status.LIMIT, "out of memory"
        except _OverriddenDrawError as error:
            status, cause = Status.ERROR, str(error)
        except Exception as error:
            status, cause = Status.ERROR, f"{type(error).__name__}: {error}"
        digest = run_digest(run) if run is not None else ""
        row = Row(task, seed, inputs, status, self._in_one_line(cause), metrics, digest)
        plans = plan_use(run) if run is not None else None
        spent = Beside(
            time.process_time() - cpu,
            time.monotonic() - wall,
            platform.node(),
            solve=plans.solve_median if plans else None,
        )
        return CaseResult(row, spent, run)

    def _run(
        self, task: Task, inputs: dict[str, Value], metrics: dict[str, float | None]
    ) -> tuple[Status, str, RunData | None]:
        """Carry out a run; return how it ended, why, and its data; fill inputs and metrics."""
        campaign = self.campaign
        scenario = self.scenario(task)
        campaign.success.require_known(dict.fromkeys(known_metrics(scenario)))
        loop = Loop(scenario)
        self.read_inputs(loop, task.case, inputs)
        most, done = campaign.limits.ticks, 0

        def is_beyond(ticks: Ticks | QuietPeriods) -> bool:
            nonlocal done
            done += len(ticks.rows.stamp_ns)
            return bool(most) and done > most

        try:
            run = run_of(loop, until=is_beyond)
        except RunWithoutPlanError as error:  # without metrics: less effort is no merit
            return Status.MISSION_FAILED, str(error), error.run
        except NoPlanError as error:
            return Status.MISSION_FAILED, str(error), None
        if most and done > most:
            return Status.LIMIT, f"more than {most} ticks", None
        if not _is_finite(run):
            return Status.NUMERIC_FAILURE, "numbers that are not finite", None
        further = (*campaign.metrics, *campaign.success.names, campaign.worst_by)
        found, lacking = metrics_of(run, scenario, further)
        metrics.update(found)
        if campaign.success.holds(metrics):
            return Status.SUCCEEDED, "", run
        cause = campaign.success.why_not(metrics)
        if lacking and (_COMPLETE in campaign.success.names or metrics["grasps_missed"]):
            cause = f"{cause}: {lacking[0]}"
        return Status.MISSION_FAILED, cause, run


def _is_finite(run: RunData) -> bool:
    """Whether all states and commands of a run are finite."""
    parts: list[Array] = [
        value
        for item in fields(run)
        if isinstance(value := getattr(run, item.name), np.ndarray) and value.dtype == np.float64
    ]
    return all(bool(np.isfinite(part).all()) for part in parts)


def in_words(row: Row, worst_by: str) -> str:
    """Return a row in one line."""
    figure = row.metrics.get(worst_by)
    shown = "" if figure is None else f", {worst_by} {figure:.4g}"
    return f"{row.task}: {row.status.value}{': ' + row.cause if row.cause else ''}{shown}"


def inputs_in_words(inputs: Mapping[str, Value]) -> str:
    """Return drawn values in one line."""
    return ", ".join(
        f"{path} {value:.6g}" if isinstance(value, float) else f"{path} {value}"
        for path, value in inputs.items()
    )
