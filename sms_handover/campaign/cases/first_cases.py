"""First cases of a campaign: whether it can be run at all, found out before there is any row."""

import tempfile
from dataclasses import replace
from pathlib import Path

from sms_handover.analysis.records import WALL_TIMES
from sms_handover.campaign.cases.case import Cases
from sms_handover.campaign.cases.case_metrics import known_metrics
from sms_handover.campaign.cases.case_row import Task
from sms_handover.campaign.definition.fields import COUNTED
from sms_handover.campaign.definition.frozen import Frozen
from sms_handover.configuration.sections import Section
from sms_handover.errors import ConfigurationError, SmsHandoverError, UnknownNameError
from sms_handover.simulation.loop import Loop
from sms_handover.simulation.parameters import PINOCCHIO
from sms_handover.simulation.scenario import Scenario

_TRIED = 10  # cases: one that no scenario can have is a row, so many on end are a slip
_DYNAMICS = "common.dynamics"


def require_runnable(frozen: Frozen, number: int | None, path: Path) -> None:
    """Raise ConfigurationError unless the campaign of a file can be run in all scenarios under all laws.

    One of the first cases must be one that the scenario can have. The loop that is made of it tells whether
    drawn values can be read back from plant and model, and have arrived.
    """
    root = Section.read(path)
    with tempfile.TemporaryDirectory(prefix="sms_handover_check_") as folder:
        cases = Cases(frozen, number, Path(folder))
        if cases.campaign.sampler.kind in COUNTED and cases.campaign.cases is None:
            raise root.error("cases is missing: give the number of cases by this key")
        for name in cases.campaign.scenarios:
            for law in cases.campaign.laws:
                scenario = _first(cases, Task(0, name, law), path)
            _require_metrics(cases, scenario, root)


def _first(cases: Cases, task: Task, path: Path) -> Scenario:
    """Return that of the first case that it can have; raises ConfigurationError if none of some can be."""
    first: Exception | None = None
    for case in range(min(cases.samples.count, _TRIED)):
        try:
            scenario = cases.scenario(task._replace(case=case))
            if task.law == cases.campaign.laws[0] and cases.campaign.paths:
                cases.read_inputs(Loop(_uncompiled(cases, scenario)), case, {})
        except (SmsHandoverError, RuntimeError) as error:
            first = first or error
        else:
            return scenario
    raise ConfigurationError(f"{path}: {task}: {first}") from first


def _uncompiled(cases: Cases, scenario: Scenario) -> Scenario:
    """Return a scenario that takes no compiler, which only the machines of the workers may have."""
    if _DYNAMICS in cases.campaign.paths:
        return scenario
    common = replace(scenario.parameters.common, dynamics=PINOCCHIO)
    return replace(scenario, parameters=replace(scenario.parameters, common=common))


def _require_metrics(cases: Cases, scenario: Scenario, root: Section) -> None:
    """Raise ConfigurationError unless a scenario has all metrics that the campaign names."""
    campaign, known = cases.campaign, dict.fromkeys(known_metrics(scenario))
    named = (
        *(("success", metric) for metric in campaign.success.names),
        *(("metrics", metric) for metric in campaign.metrics),
        ("worst_by", campaign.worst_by),
    )
    for key, metric in named:
        where = root.where(key if key in root else None)
        if metric in WALL_TIMES:
            raise ConfigurationError(
                f"{where}: metric {metric!r} is of wall time, which differs from run to run: take one of "
                "simulated time; the page has the solve times of laws that plan"
            )
        if metric not in known:
            raise UnknownNameError("metric", metric, known, f"{where}: {key}", "sms-handover list metrics")
