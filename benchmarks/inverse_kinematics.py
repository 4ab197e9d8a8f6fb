"""Dual-arm inverse kinematics from a near seed: time and iterations of several solvers.

Every solver gets the same targets and seeds, iterates until both tools are within 1 um and 1 urad, and
keeps the joint limits. The others are differential: one call gives a joint velocity, so they are iterated
with a unit time step, as their examples do.
"""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import mink
import mujoco
import numpy as np
import pink
import pinocchio as pin

from benchmarks.machine import versions
from benchmarks.results import Result, Table, publish, row
from sms_handover.frames import tool_frame
from sms_handover.ik.levenberg_marquardt import solve_ik
from sms_handover.model.mjcf import to_mjcf
from sms_handover.model.poses import se3_of
from sms_handover.model.robot_model import RobotModel
from sms_handover.simulation.scenario import load_parameters
from sms_handover.types import Array, IkRequest, IkStatus, Pose

NEAR = (0.005, 0.05)  # [rad] distance of a seed in every joint
TARGETS = 150
REPEATS = 5
TOLERANCE = 1e-6  # [m, rad]
BUDGET = 100  # [-] iterations
DAMPING = 1e-6  # [-] constant part, the same for all
BASE = Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))

Answer = tuple[bool, int]  # whether the targets were met, iterations
Solver = Callable[[Array, dict[str, Pose]], Answer]


@dataclass(frozen=True, eq=False)
class Problem:
    """Targets of both tools and a seed (n,) from which they are near."""

    seed: Array
    targets: dict[str, Pose]


def problems(robot: RobotModel, near: float) -> list[Problem]:
    """Draw reachable targets, and seeds near the joints that reach them."""
    random = np.random.default_rng(7)
    found = []
    for _ in range(TARGETS):
        joints = random.uniform(np.maximum(robot.lower, -np.pi) + 0.1, np.minimum(robot.upper, np.pi) - 0.1)
        seed = joints + random.uniform(-near, near, joints.size)
        found.append(Problem(seed, robot.tools_in_world(BASE, joints)))
    return found


def ours(robot: RobotModel) -> Solver:
    """Return our solver, with the shipped parameters."""
    parameters = load_parameters().ik

    def solve(seed: Array, targets: dict[str, Pose]) -> Answer:
        result = solve_ik(robot, IkRequest(BASE, seed, targets), parameters)
        return result.status is IkStatus.CONVERGED, result.iterations

    return solve


def with_mink(robot: RobotModel) -> Solver:
    """Return mink's, on the robot in MuJoCo with its base fixed."""
    model = mujoco.MjModel.from_xml_string(to_mjcf(robot.urdf, floating=False))
    at, limits = mink.Configuration(model), [mink.ConfigurationLimit(model, gain=1.0)]
    tasks = {arm: mink.FrameTask(tool_frame(arm), "site", 1.0, 1.0, lm_damping=1.0) for arm in robot.arms}

    def solve(seed: Array, targets: dict[str, Pose]) -> Answer:
        for arm, target in targets.items():
            attitude = mink.SO3(np.roll(target.quaternion_xyzw, 1))
            tasks[arm].set_target(mink.SE3.from_rotation_and_translation(attitude, target.position))
        at.update(seed)
        every = list(tasks.values())
        for iteration in range(BUDGET + 1):
            if all(_met(task.compute_error(at)) for task in every):
                return True, iteration
            step = mink.solve_ik(at, every, 1.0, "daqp", damping=DAMPING, limits=limits)
            at.integrate_inplace(step, 1.0)
        return False, BUDGET

    return solve


def with_pink(robot: RobotModel) -> Solver:
    """Return pink's, on the same Pinocchio model with its base fixed."""
    model = pin.buildModelFromXML(robot.urdf)
    limits = [pink.limits.ConfigurationLimit(model, 1.0)]
    tasks = {arm: pink.FrameTask(tool_frame(arm), 1.0, 1.0, lm_damping=1.0) for arm in robot.arms}

    def solve(seed: Array, targets: dict[str, Pose]) -> Answer:
        for arm, target in targets.items():
            tasks[arm].set_target(se3_of(target))
        at = pink.Configuration(model, model.createData(), seed)
        every = list(tasks.values())
        for iteration in range(BUDGET + 1):
            if all(_met(task.compute_error(at)) for task in every):
                return True, iteration
            step = pink.solve_ik(at, every, 1.0, solver="daqp", damping=DAMPING, limits=limits)
            at.integrate_inplace(step, 1.0)
        return False, BUDGET

    return solve


def _met(error: Array) -> bool:
    """Whether a tool is within the tolerance of its target."""
    return bool(max(np.linalg.norm(error[:3]), np.linalg.norm(error[3:])) <= TOLERANCE)


def measure(solvers: dict[str, Solver], given: list[Problem]) -> dict[str, tuple[float, float, float]]:
    """Return per solver the median time in s, the median iterations and the share that was met."""
    seconds: dict[str, list[float]] = {name: [] for name in solvers}
    answers: dict[str, list[Answer]] = {name: [] for name in solvers}
    for problem in given:
        for name, solve in solvers.items():
            times = []
            for _ in range(REPEATS):
                start = perf_counter()
                answer = solve(problem.seed, problem.targets)
                times.append(perf_counter() - start)
            seconds[name].append(min(times))
            answers[name].append(answer)
    return {
        name: (
            float(np.median(seconds[name])),
            float(np.median([count for _, count in answers[name]])),
            float(np.mean([met for met, _ in answers[name]])),
        )
        for name in solvers
    }


def main() -> None:
    """Measure and publish."""
    robot = RobotModel.load()
    solvers = {"ours": ours(robot), "pink, iterated": with_pink(robot), "mink, iterated": with_mink(robot)}
    rows, values = [], {}
    for near in NEAR:
        found = measure(solvers, problems(robot, near))
        for name, (seconds, iterations, met) in found.items():
            values[f"{name}, {near}"] = 1e6 * seconds
            ratio = seconds / found["ours"][0]
            rows.append(row(f"{near:g}", name, 1e6 * seconds, f"{iterations:g}", ratio, f"{100 * met:.0f} %"))
    heading = ("seed within [rad]", "solver", "median [us]", "median iterations", "time over ours", "met")
    publish(
        Result(
            name="inverse_kinematics",
            question="How long does inverse kinematics of both arms take?",
            notes=[
                f"{TARGETS} targets of both tools at random joint angles, from seeds near them, to "
                f"{TOLERANCE:g} m and rad; the base is locked. The shortest of {REPEATS} solves counts, then "
                "the median over the targets. The others are differential and iterated with a unit step. "
                f"Compared: {versions(('pin', 'pin-pink', 'mink', 'mujoco', 'daqp'))}."
            ],
            tables=[Table(heading, rows)],
            values=values,
        )
    )


if __name__ == "__main__":
    main()
