"""What the tests of the core share: the robot, random states, schedules in files, and two whole runs."""

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.control.nmpc import NmpcGains, NmpcLaw
from sms_handover.control.pid import PidGains, PidLaw
from sms_handover.model.poses import pose_of
from sms_handover.model.reduced import reduced_dynamics
from sms_handover.model.robot_model import BASE_NV, RobotModel
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import Overrides, Scenario, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.types import Array, Pose, RobotState

from .report_bags import write_handovers

# A central difference of step h errs by h^2 f'''/6 + eps f/h. With every quantity here below 10 in
# value and third derivative (m, rad, kg, s) that is 1.7e-10 + 2.2e-10.
FD_STEP = 1e-5
FD_BOUND = 4e-10


Gains = NmpcGains | PidGains


def law_of(robot: RobotModel, gains: Gains) -> NmpcLaw | PidLaw:
    """Return a fresh law with these gains."""
    return NmpcLaw(robot, gains) if isinstance(gains, NmpcGains) else PidLaw(robot, gains)


class Draw:
    """Random states of a robot from one seed."""

    def __init__(self, robot: RobotModel, seed: int) -> None:
        """Start the sequence."""
        self.robot = robot
        self.random = np.random.default_rng(seed)

    def vector(self, size: int, scale: float = 1.0) -> Array:
        """Return numbers uniform in [-scale, scale]."""
        return self.random.uniform(-scale, scale, size)

    def pose(self, reach: float = 1.0) -> Pose:
        """Return a pose with any orientation."""
        rotation = pin.exp3(self.vector(3, 2.0))
        return pose_of(pin.SE3(rotation, self.vector(3, reach)))

    def near(self, pose: Pose, distance: float) -> Pose:
        """Return a pose up to ``distance`` in m and rad along each axis away from another."""
        turned = pin.Quaternion(pose.quaternion_xyzw).matrix() @ pin.exp3(self.vector(3, distance))
        return pose_of(pin.SE3(turned, pose.position + self.vector(3, distance)))

    def joints(self, margin: float = 0.0) -> Array:
        """Return joint angles within their limits, and within half a turn."""
        low = np.maximum(self.robot.lower, -np.pi) + margin
        high = np.minimum(self.robot.upper, np.pi) - margin
        return self.random.uniform(low, high)

    def q(self) -> Array:
        """Return a configuration."""
        return self.robot.configuration(self.pose(), self.joints())

    def v(self, scale: float = 1.0) -> Array:
        """Return a velocity."""
        return self.vector(self.robot.pin.nv, scale)

    def effort(self, q: Array, scale: float = 2.0) -> Array:
        """Return joint efforts that accelerate every joint by up to about ``scale`` rad/s^2.

        Efforts of equal size would spin the light wrist up by thousands of rad/s^2.
        """
        inertia = reduced_dynamics(self.robot, q, np.zeros(self.robot.pin.nv)).inertia
        return np.asarray(inertia @ self.vector(self.robot.n_joints, scale))

    def state(self, speed: float = 1.0) -> RobotState:
        """Return a state."""
        v = self.v(speed)
        return RobotState(0, self.q(), v, np.zeros(v.size - BASE_NV))


def slope(steps: list[float], errors: list[float]) -> float:
    """Return the measured order: the regression slope of log error over log step."""
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def distance(robot: RobotModel, a: tuple[Array, Array], b: tuple[Array, Array]) -> float:
    """Return how far apart two states (q, v) are on the manifold, in mixed SI units."""
    apart = np.concatenate([pin.difference(robot.pin, a[0], b[0]), a[1] - b[1]])
    return float(np.linalg.norm(apart))


def state_of(robot: RobotModel, q: Array, v: Array, stamp_ns: int = 0) -> RobotState:
    """Return a state from configuration and velocity."""
    return RobotState(stamp_ns, q, v, np.zeros(robot.n_joints))


def row_distance(a: Array, b: Array) -> tuple[float, float]:
    """Return distance in m and angle in rad between two pose rows (7,), with no code of the package."""
    (x, y, z, w), (p, q, r, s) = a[3:], b[3:]
    vector = np.array(  # vector part of conj(a) * b
        [w * p - x * s - y * r + z * q, w * q + x * r - y * s - z * p, w * r - x * q + y * p - z * s]
    )
    angle = 2.0 * np.arctan2(np.linalg.norm(vector), abs(x * p + y * q + z * r + w * s))
    return float(np.linalg.norm(a[:3] - b[:3])), float(angle)


@pytest.fixture(scope="session")
def compiled_cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder for the libraries of this run, of all workers of pytest-xdist, so that each is made once."""
    base = tmp_path_factory.getbasetemp()
    return (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "compiled"


@pytest.fixture(scope="module")
def kept_libraries(compiled_cache: Path) -> Iterator[None]:
    """That folder for the libraries of a whole module."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(compiled_cache))
        yield


@pytest.fixture(scope="session")
def robot() -> RobotModel:
    """The robot as shipped."""
    return RobotModel.load()


@pytest.fixture
def draw(robot: RobotModel) -> Draw:
    """Random states, the same in every run of a test."""
    return Draw(robot, seed=20)


@pytest.fixture(scope="session")
def scenario() -> Scenario:
    """The shipped scenario."""
    return load_scenario("colliding")


# One handover in small: every kind of target and event, with poses of its own. All targets are in reach
# and fit the deputy, but the phases are far too short for a robot to arrive.
SCHEDULE = """\
initial:
  base_in_world: {xyz: [0.1, -0.2, 0.3], rpy: [0.0, 0.0, 0.05]}
  joints:
    arm_a: [0.7, -1.7, 1.4, 1.9, 1.6, -1.4, 1.2]
    arm_b: [-0.7, -1.7, -1.4, 1.9, -1.6, -1.4, -1.2]

deputy:
  mass: 0.0
  size: [0.1, 0.34, 0.1]
  in_world: {xyz: [1.25, 0.0, 0.75], rpy: [0.0, 0.1, 0.0]}
  grasp_frames:
    left: {xyz: [-0.05, 0.12, 0.0], rpy: [3.14, -1.5, 0.0]}
    right: {xyz: [-0.05, -0.12, 0.0], rpy: [3.14, -1.5, 0.0]}

phases:
  - name: approach
    start: 0.0
    duration: 0.4
    motion: 0.3
    arms:
      arm_a: {grasp_frame: left}
      arm_b: hold

  - name: carry
    duration: 0.6
    events:
      - grasp: {arm: arm_a, grasp_frame: left}
    arms:
      arm_a:
        tool_in_world: {xyz: [1.15, 0.02, 0.75], rpy: [3.14, -1.5, 0.0]}
      arm_b: {tool_in_world: {xyz: [1.15, -0.22, 0.75], rpy: [3.14, -1.5, 0.0]}}
    gains:
      nmpc: {rolling_period: 2.0}

  - name: withdraw
    start: 1.0
    duration: 0.2
    events:
      - transfer: {from: arm_a, to: arm_b, grasp_frame: right}
    arms:
      arm_a: {joints: [0.6, -1.6, 1.3, 1.8, 1.5, -1.3, 1.1]}
      arm_b: {tool_in_world: {xyz: [1.2, -0.42, 0.75], rpy: [3.14, -1.5, 0.0]}}

  - name: let go
    duration: 0.2
    events:
      - release: {arm: arm_b}
    arms:
      arm_a: hold
      arm_b:
        grasp_frame: right
        tool_in_grasp_frame: {xyz: [0.0, 0.0, -0.05], rpy: [0.0, 0.0, 0.0]}
"""

MakeScenario = Callable[..., Scenario]


@pytest.fixture
def make_scenario(tmp_path: Path) -> MakeScenario:
    """Return a function that makes a scenario from the text of a schedule and overrides of parameters."""

    def make(text: str = SCHEDULE, **overrides: dict[str, object]) -> Scenario:
        path = tmp_path / "schedule.yaml"
        path.write_text(text, encoding="utf-8")
        common = {"schedule": str(path), **overrides.pop("common", {})}
        return load_scenario("colliding", {"common": common, **overrides})

    return make


def run(**overrides: dict[str, object]) -> RunData:
    """Return a run of the shipped schedule with overrides of parameters."""
    given: Overrides = overrides
    return simulate(load_scenario("colliding", given))


@pytest.fixture(scope="session")
def nmpc_run() -> RunData:
    """The whole shipped handover under NMPC."""
    return run(controller={"law": "nmpc"})


@pytest.fixture(scope="session")
def pid_run() -> RunData:
    """The whole shipped handover under PID."""
    return run(controller={"law": "pid"})


@pytest.fixture(params=["nmpc", "pid"])
def handover(request: pytest.FixtureRequest) -> RunData:
    """The whole shipped handover, under each law in turn."""
    data: RunData = request.getfixturevalue(f"{request.param}_run")
    return data


@pytest.fixture(scope="session")
def handover_bags(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The bags of a short handover, by law."""
    return write_handovers(tmp_path_factory.mktemp("handovers"))
