"""How much work a tick is: counted, not timed, so that a slow-down shows on any machine.

Counted are calls of Pinocchio, evaluations of the right-hand side, iterations of inverse kinematics and
memory. Whoever makes one of these larger on purpose changes the number here and says why.
"""

import gc
import sys
import tracemalloc
from collections import Counter
from collections.abc import Callable
from functools import wraps
from types import FrameType
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.control.protocol import Controller, Guidance
from sms_handover.ik.levenberg_marquardt import solve_ik
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.plant.integrators import TABLEAUS, LieGroupIntegrator
from sms_handover.simulation.scenario import Overrides, Scenario, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.simulation.wiring import make_controller, make_plant
from sms_handover.types import Array, IkRequest, IkStatus, JointReference, TaskPhase

from .conftest import Draw

_ALGORITHMS = (
    *("aba", "crba", "rnea", "nonLinearEffects", "computeMinverse", "computeAllTerms", "integrate"),
    *("forwardKinematics", "updateFramePlacement", "updateFramePlacements", "computeJointJacobians"),
    *("getFrameJacobian", "computeFrameJacobian", "getFrameVelocity", "centerOfMass"),
    *("computeCentroidalMomentum", "log3", "Jlog3", "exp3", "exp6"),
)


def count_calls(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Put a counter before every algorithm of Pinocchio; return the calls by name, as they are made."""
    calls: Counter[str] = Counter()

    def counting(name: str, algorithm: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(algorithm)
        def counted(*arguments: Any) -> Any:
            calls[name] += 1
            return algorithm(*arguments)

        return counted

    for name in _ALGORITHMS:
        monkeypatch.setattr(pin, name, counting(name, getattr(pin, name)))
    return calls


class TickBench:
    """Plant and controller of a scenario with a reference to track, as between two reference periods."""

    def __init__(self, scenario: Scenario) -> None:
        """Start with every joint a little away from its desired position."""
        parameters, robot, schedule = scenario.parameters, scenario.truth.robot, scenario.truth.schedule
        self.plant: FreeFloatingPlant = make_plant(robot, schedule, parameters.common, parameters.plant)
        self.controller: Controller = make_controller(
            robot, schedule, parameters.common, parameters.controller
        )
        joints = self.plant.state.joint_position
        reference = JointReference(0, joints + 0.01, np.zeros_like(joints))
        self.controller.guide(Guidance(TaskPhase(0, 0, ""), reference, {}))

    def tick(self) -> None:
        """Answer a state and integrate."""
        plant = self.plant
        plant.apply(self.controller.effort(plant.stamp_ns, plant.q, plant.v))


def _loop(overrides: Overrides | None = None) -> TickBench:
    """Return the loop of the shipped scenario with overrides."""
    return TickBench(load_scenario("colliding", overrides))


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        ({}, {"aba": 4, "integrate": 5, "crba": 1, "rnea": 1}),
        ({"plant": {"integrator": "midpoint"}}, {"aba": 2, "integrate": 2, "crba": 1, "rnea": 1}),
        ({"controller": {"law": "pid"}}, {"aba": 4, "integrate": 5}),
        ({"common": {"dynamics": "compiled"}}, {}),
    ],
)
def test_a_tick_calls_pinocchio_as_often_as_its_equations_ask(
    monkeypatch: pytest.MonkeyPatch, overrides: Overrides, expected: dict[str, int]
) -> None:
    """One forward dynamics per stage, one inverse dynamics and mass matrix under NMPC, and nothing else."""
    loop = _loop(overrides)
    calls = count_calls(monkeypatch)
    for _ in range(3):
        loop.tick()
    assert calls == {name: 3 * count for name, count in expected.items()}


@pytest.mark.parametrize(("name", "stages"), [("midpoint", 2), ("rk4", 4)])
def test_a_step_evaluates_its_right_hand_side_once_per_stage(draw: Draw, name: str, stages: int) -> None:
    """An explicit scheme of order four needs four stages, one of order two needs two."""
    evaluated = []

    def acceleration(q: Array, v: Array) -> Array:
        evaluated.append(q)
        return np.zeros_like(v)

    LieGroupIntegrator(draw.robot.pin, TABLEAUS[name], 1e-3).step(acceleration, draw.q(), draw.v())
    assert len(evaluated) == stages


def test_a_reference_period_adds_little(monkeypatch: pytest.MonkeyPatch) -> None:
    """Phase, targets, inverse kinematics, reference and record of one period: calls beyond those of ticks.

    With one arm led by its tool and at its target: two forward kinematics for the tools, one each for the
    residual at the seed and after every iteration, one at the start of a phase.
    """
    scenarios = [
        load_scenario("colliding", {"common": {"duration": duration}}) for duration in (20e-3, 40e-3)
    ]
    counted = []
    for scenario in scenarios:
        with monkeypatch.context() as patch:
            calls = count_calls(patch)
            simulate(scenario)
        counted.append(calls)
    period = counted[1] - counted[0]
    assert {name: period[name] for name in ("aba", "integrate", "rnea")} == {
        "aba": 80,
        "integrate": 100,
        "rnea": 20,
    }
    assert period["crba"] == 20 + 1  # and one for the kinetic energy
    iterations = 5  # [-] from the start towards a target that is far away
    assert period["forwardKinematics"] <= 2 + 1 + iterations
    assert period["computeJointJacobians"] <= iterations  # the manipulability is only for who asks for it
    assert period.total() <= 20 * 11 + 46


def test_inverse_kinematics_from_near_takes_few_iterations(
    monkeypatch: pytest.MonkeyPatch, draw: Draw, scenario: Scenario
) -> None:
    """Both arms from within 0.05 rad: four in the median, with one Jacobian of each tool in every one."""
    robot = scenario.truth.robot
    iterations = []
    calls = count_calls(monkeypatch)
    for _ in range(100):
        base, joints = draw.pose(), draw.joints(margin=0.3)
        targets = robot.tools_in_world(base, joints)
        before = calls.copy()
        result = solve_ik(
            robot, IkRequest(base, joints + draw.vector(14, 0.05), targets), scenario.parameters.ik
        )
        made = calls - before
        if result.status is IkStatus.CONVERGED:
            iterations.append(result.iterations)
            assert made["computeJointJacobians"] == result.iterations + 1
            assert made["getFrameJacobian"] == 2 * result.iterations
    assert np.median(iterations) <= 4


def test_a_tick_leaves_nothing_behind() -> None:
    """After a thousand ticks no more memory is in use than after the first few."""
    loop = _loop()
    for _ in range(100):
        loop.tick()
    gc.collect()
    before = sys.getallocatedblocks()
    for _ in range(1000):
        loop.tick()
    gc.collect()
    assert sys.getallocatedblocks() - before < 100


def test_a_tick_holds_little_memory_at_a_time() -> None:
    """State, command and desired motion with a few arrays of work: no more than 8 KiB at any time."""
    loop = _loop()
    for _ in range(10):
        loop.tick()
    tracemalloc.start()
    try:
        loop.tick()
        tracemalloc.reset_peak()
        start, _ = tracemalloc.get_traced_memory()
        loop.tick()
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak - start <= 8 * 1024  # [B]


def test_a_tick_makes_few_calls_in_python() -> None:
    """What is not Pinocchio or NumPy is overhead: no more than 45 functions of Python are entered."""
    loop = _loop()
    loop.tick()
    entered: Counter[str] = Counter()

    def count(frame: FrameType, event: str, _: object) -> None:
        if event == "call":
            entered[frame.f_code.co_name] += 1

    sys.setprofile(count)
    try:
        loop.tick()
    finally:
        sys.setprofile(None)
    assert entered.total() <= 45, entered
