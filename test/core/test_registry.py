"""Control laws by name: ours, and one of a package that nobody here knows."""

from dataclasses import make_dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from my_controller.law import LAW
from my_controller.task_space_pd import TaskSpaceGains, TaskSpacePd

from sms_handover.analysis.equality import compare_runs
from sms_handover.configuration.parameters import parameter
from sms_handover.control.law import Law, LawSetup, Need
from sms_handover.control.nmpc import NMPC
from sms_handover.control.parameters import ControllerParameters, parameters_with
from sms_handover.control.pid import PidGains
from sms_handover.control.protocol import inner_of
from sms_handover.control.registry import law_named, law_names
from sms_handover.errors import ConfigurationError, UnknownNameError
from sms_handover.simulation.check import check_scenario
from sms_handover.simulation.parameters import CommonParameters
from sms_handover.simulation.scenario import Scenario, load_parameters, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.simulation.wiring import gains_by_phase, make_controller
from sms_handover.trajectory.preview import TargetPreview

from .conftest import SCHEDULE
from .laws import offer

THIRD = "task_space_pd"
CLASHING = Law("clashing", "", PidGains, lambda setup: TaskSpacePd(setup.robot))


class Wanting(TaskSpacePd):
    """A law that keeps what it was made with."""

    def __init__(self, setup: LawSetup[TaskSpaceGains]) -> None:
        super().__init__(setup.robot)
        self.setup = setup


WANTING = Law("wanting", "", TaskSpaceGains, Wanting, needs=frozenset({Need.PREVIEW, Need.CLEARANCE}))


@pytest.fixture
def third(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package with a third law is installed."""
    monkeypatch.syspath_prepend(offer(tmp_path / "site", "my_controller", **{THIRD: "my_controller.law:LAW"}))


def scenario_of(folder: Path, **controller: object) -> Scenario:
    """Return a short handover under the third law, with a gain of it in the second phase."""
    file = folder / "schedule.yaml"
    gains = "      nmpc: {rolling_period: 2.0}"
    file.write_text(SCHEDULE.replace(gains, f"{gains}\n      {THIRD}: {{stiffness: 2.0}}"), encoding="utf-8")
    return load_scenario(
        "colliding", {"common": {"schedule": str(file)}, "controller": {"law": THIRD, **controller}}
    )


@pytest.mark.usefixtures("third")
def test_a_law_of_another_package_runs_by_its_name(tmp_path: Path) -> None:
    """With its gains from the parameters and, by phase, from the schedule; the same bits as by hand."""
    assert law_names() == ("nmpc", "pid", "mpc", THIRD) and law_named(THIRD) is LAW
    scenario = scenario_of(tmp_path, damping=6.0)
    gains = gains_by_phase(scenario.truth.schedule, scenario.parameters.controller)
    assert [(g.stiffness, g.damping) for g in gains] == [(5.0, 6.0), (2.0, 6.0), (5.0, 6.0), (5.0, 6.0)]

    class ByHand(TaskSpacePd):
        def guide(self, guidance: object) -> None:
            self.use(gains[guidance.phase.index])  # type: ignore[attr-defined]
            super().guide(guidance)  # type: ignore[arg-type]

    run = simulate(scenario)
    assert compare_runs(run, simulate(scenario, controller=ByHand(scenario.truth.robot))) == ()
    assert np.any(run.joint_command)
    check_scenario(load_scenario("colliding", {"controller": {"law": THIRD}}))  # not linearised: no verdict


@pytest.mark.usefixtures("third")
def test_its_parameters_are_checked_as_ours_are(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"'stiffness' is -1.0 N/m"):
        load_parameters({"controller": {"law": THIRD, "stiffness": -1.0}})
    with pytest.raises(UnknownNameError, match=r"'stifness' \(did you mean 'stiffness'\?\)"):
        load_parameters({"controller": {"law": THIRD, "stifness": 1.0}})
    with pytest.raises(UnknownNameError, match=r"unknown parameter 'stiffness'"):
        load_parameters({"controller": {"stiffness": 1.0}})
    wrong = load_scenario(
        "colliding", {"common": {"schedule": str(_misspelt(tmp_path))}, "controller": {"law": THIRD}}
    )
    with pytest.raises(UnknownNameError, match=rf"phase 'carry': unknown gain of {THIRD} 'stifness'"):
        gains_by_phase(wrong.model.schedule, wrong.parameters.controller)


def _misspelt(folder: Path) -> Path:
    """Return a schedule with a gain that the third law does not have."""
    file = folder / "misspelt.yaml"
    text = SCHEDULE.replace("nmpc: {rolling_period: 2.0}", f"{THIRD}: {{stifness: 2.0}}")
    file.write_text(text, encoding="utf-8")
    return file


def test_an_unknown_law_is_named_with_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match=r"unknown control law 'nmcp' \(did you mean 'nmpc'\?\)"):
        load_parameters({"controller": {"law": "nmcp"}})
    file = tmp_path / "mine.yaml"
    file.write_text("controller:\n  ros__parameters:\n    law: pdi\n", encoding="utf-8")
    with pytest.raises(UnknownNameError, match=r"mine\.yaml:3: parameter 'law': unknown control law 'pdi'"):
        load_parameters({}, [file])
    assert parameters_with(NMPC, CommonParameters) is ControllerParameters


@pytest.mark.parametrize(
    ("places", "said"),
    [
        (["no_such_module:LAW"], "control law 'odd' of one_0 cannot be loaded: No module named 'no_such"),
        (["my_controller.law:NONE"], "control law 'odd' of one_0 cannot be loaded: .* 'NONE'"),
        (["my_controller.law:LAW"], "entry point 'odd' of one_0 must refer to a Law of this name"),
        (["math:pi"], "must refer to a Law of this name, not 3.14"),
        (["math:pi", "math:e"], "control law 'odd' is offered by one_[01], one_[01]: uninstall all but one"),
    ],
)
def test_what_is_no_law_is_refused(
    places: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number, place in enumerate(places):
        monkeypatch.syspath_prepend(offer(tmp_path / str(number), f"one_{number}", odd=place))
    with pytest.raises(ConfigurationError, match=said):
        load_parameters({"controller": {"law": "odd"}})


def test_a_law_gets_what_it_declares_to_need(
    scenario: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Preview and distances of bodies; but no parameter that the controller has already."""
    here = "test.core.test_registry"
    monkeypatch.setitem(__import__("sys").modules, here, __import__("sys").modules[__name__])
    laws = {"clashing": f"{here}:CLASHING", "wanting": f"{here}:WANTING"}
    monkeypatch.syspath_prepend(offer(tmp_path, "odd", **laws))
    with pytest.raises(ConfigurationError, match="'clashing' has a parameter 'proportional', as the contr"):
        load_parameters({"controller": {"law": "clashing"}})
    own = make_dataclass("Own", [("clearance", float, parameter("one of every node's"))], frozen=True)
    with pytest.raises(ConfigurationError, match="'clashing' has a parameter 'clearance', as the contr"):
        parameters_with(replace(CLASHING, parameters=own), CommonParameters)
    parameters = load_parameters({"controller": {"law": "wanting"}})
    robot, schedule = scenario.truth.robot, scenario.truth.schedule
    made = inner_of(make_controller(robot, schedule, parameters.common, parameters.controller))
    assert isinstance(made, Wanting) and isinstance(made.setup.preview, TargetPreview)
    assert made.setup.distances and len(made.setup.distances.pairs) > 100
