"""Conservation laws and order of the integrators.

Nothing outside acts on the robot, so its momenta and its centre of mass stay, its energy is the work
of its motors, and whatever departs from that is the integrator's error of its declared order.
"""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.model.description import load_robot
from sms_handover.model.reduced import base_twist_per_joint_rate, reduced_inverse_dynamics
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.plant.integrators import TABLEAUS, Tableau
from sms_handover.run_data import RunData
from sms_handover.types import Array
from test.core.conftest import Draw, distance, slope
from test.core.test_integrators import Top, _advance, _driven
from test.core.test_plant import Drift
from test.evidence import Record, Table
from test.verification.lagrangian import Lagrangian
from test.verification.test_claims import handover

_EPS = float(np.finfo(float).eps)
_ORDER_TOLERANCE = 0.1  # [-] what is asked of a measured order
_LAWS = (
    ("linear momentum", "kg m/s"),
    ("angular momentum about the centre of mass", "kg m^2/s"),
    ("way of the centre of mass", "m"),
    ("energy less work", "J"),
)
_REFLECTED = (0.40, 0.40, 0.40, 0.40, 0.22, 0.22, 0.22)  # [kg m^2] third-party values for the Gen3


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    """The robot as shipped."""
    return RobotModel.load()


@pytest.fixture
def draw(robot: RobotModel) -> Draw:
    """Random states, the same in every run of a test."""
    return Draw(robot, seed=20)


@pytest.fixture(params=sorted(TABLEAUS))
def integrator(request: pytest.FixtureRequest) -> str:
    """Every integrator that a user can choose."""
    return str(request.param)


def _with_rotors() -> RobotModel:
    """Return the robot with motors whose rotors spin."""
    description = load_robot()
    arms = [
        replace(arm, joints=tuple(replace(joint, rotor_inertia=kg_m2) for joint, kg_m2 in pairs))
        for arm in description.arms
        for pairs in [list(zip(arm.joints, _REFLECTED, strict=True))]
    ]
    return RobotModel(replace(description, arms=tuple(arms)))


def _rounding(energy: float, ticks: int) -> float:
    """Return what rounding adds to a momentum at most: ticks eps sum m|v| <= ticks eps sqrt(2 M E)."""
    return ticks * _EPS * float(np.sqrt(2.0 * 254.0 * energy))


@pytest.mark.parametrize("kind", ["the shipped robot", "a robot with rotor inertia"])
def test_conservation_under_random_efforts(
    integrator: str, kind: str, robot: RobotModel, record: Record
) -> None:
    """At the shipped tick each law holds as well as the order promises from a run at four times the tick."""
    tested = robot if kind == "the shipped robot" else _with_rotors()
    ticks = (1, 2, 4)  # [ms]
    runs = [Drift(tested, integrator, tick) for tick in ticks]
    order = TABLEAUS[integrator].order
    about = f"{kind}, {integrator}, 0.8 s of random efforts, 1 ms"
    for index, (law, unit) in enumerate(_LAWS):
        found = [float(run.worst[index]) for run in runs]
        bound = 2.0 * found[2] / 4.0**order + _rounding(runs[0].energy, 800)
        against = f"2 x (departure at 4 ms) / 4^{order} + rounding"
        record(f"{law}: largest departure, {about}", found[0], bound, unit=unit, against=against)
        if kind == "the shipped robot":
            off = abs(
                slope([2.0, 4.0, 8.0], [*found[1:], float(Drift(tested, integrator, 8).worst[index])]) - order
            )
            claim = f"{law}: order of the departure, less {order} ({integrator})"
            record(claim, off, _ORDER_TOLERANCE, against="order of the tableau")


@pytest.mark.parametrize("law", ["nmpc", "pid"])
def test_conservation_over_the_whole_handover(law: str, robot: RobotModel, record: Record) -> None:
    """Over all 60 s of the handover only rounding is left."""
    run = handover(law)
    centre = _largest_way_of_the_centre(robot, run)
    ticks = run.tick_ns.size
    energy = float(np.max(run.kinetic_energy))
    rounding = _rounding(energy, ticks)
    linear, angular = (float(np.max(np.abs(m))) for m in (run.linear_momentum, run.angular_momentum))
    work = float(np.max(np.abs(run.kinetic_energy - run.work)))
    against = "rounding: ticks eps sqrt(2 M E)"
    about = f"whole handover under {law}"
    record(f"linear momentum: largest, {about}", linear, rounding, unit="kg m/s", against=against)
    record(f"angular momentum: largest, {about}", angular, rounding, unit="kg m^2/s", against=against)
    seconds = float(run.tick_ns[-1]) * 1e-9
    record(f"way of the centre of mass, {about}", centre, seconds * rounding, unit="m", against=against)
    record(f"energy less work, {about}", work / energy, ticks * _EPS, against="rounding: ticks eps")


def _largest_way_of_the_centre(robot: RobotModel, run: RunData) -> float:
    """Return how far the centre of mass has come from its start, in m."""
    centres = [
        np.array(pin.centerOfMass(robot.pin, robot.data, np.concatenate([base, joints])))
        for base, joints in zip(run.base_pose[::20], run.joint_position[::20], strict=True)
    ]
    return float(np.max(np.linalg.norm(np.array(centres) - centres[0], axis=1)))


def test_order_on_the_robot(robot: RobotModel, draw: Draw, integrator: str, record: Record) -> None:
    """The error of a tumbling robot under joint efforts falls with the step to the declared power."""
    tableau = TABLEAUS[integrator]
    start = (draw.q(), draw.v())
    rate = _driven(robot, draw.effort(start[0]))
    exact = _advance(robot.pin, TABLEAUS["rk4"], rate, start, 0.4, 1600)
    counts = [50, 100, 200]
    errors = [distance(robot, _advance(robot.pin, tableau, rate, start, 0.4, n), exact) for n in counts]
    off = abs(slope([0.4 / n for n in counts], errors) - tableau.order)
    claim = f"{integrator}: order on the tumbling robot, less {tableau.order}"
    record(claim, off, _ORDER_TOLERANCE, against="rk4 at an eighth of the step")


def test_order_on_the_free_top(draw: Draw, integrator: str, record: Record) -> None:
    """A spinning symmetric body precesses as Euler found."""
    top, tableau = Top(draw), TABLEAUS[integrator]
    counts = [100, 200, 400]
    errors = [top.error(tableau, 2.0, n) for n in counts]
    off = abs(slope([2.0 / n for n in counts], errors) - tableau.order)
    claim = f"{integrator}: order on the free symmetric top, less {tableau.order}"
    record(claim, off, _ORDER_TOLERANCE, against="closed form by Euler")


def test_time_reversal(robot: RobotModel, draw: Draw, integrator: str, record: Record) -> None:
    """With every velocity reversed and the same efforts the robot retraces its way."""
    tableau = TABLEAUS[integrator]
    q, v = draw.q(), draw.v()
    rate = _driven(robot, draw.effort(q))
    counts, errors = [25, 50, 100, 400], []
    for n in counts:
        there = _advance(robot.pin, tableau, rate, (q, v), 0.4, n)
        back = _advance(robot.pin, tableau, rate, (there[0], -there[1]), 0.4, n)
        errors.append(distance(robot, (back[0], -back[1]), (q, v)))
    short = tableau.order - slope([0.4 / n for n in counts[:3]], errors[:3])
    claim = f"time reversal, {integrator}: {tableau.order} less the order with which the start is met"
    record(claim, short, _ORDER_TOLERANCE, against="order of the tableau, or better")
    bound = 2.0 * errors[2] / 4.0**tableau.order + 800 * _EPS * float(np.linalg.norm(v))
    claim = f"time reversal, {integrator}: distance from the start after 0.4 s and back, 1 ms"
    record(
        claim, errors[3], bound, unit="SI", against=f"2 x (distance at 4 ms) / 4^{tableau.order} + rounding"
    )


class Loop:
    """Joints 2 and 4 of arm A go round a circle and come back; the base has turned by then.

    The joints obey q_m'' = -w^2 (q_m - centre), whose solution is a circle in the plane of two joints, so
    the efforts depend on the state alone. The robot has no momentum.
    """

    radius = 0.4  # [rad]

    def __init__(self, robot: RobotModel, centre: Array, period: float) -> None:
        """Set up a circle around a configuration, gone round once per ``period`` s."""
        self.robot, self.centre, self.period = robot, centre, period
        self.pulsation = 2.0 * np.pi / period

    def joints(self, phase: float) -> Array:
        """Return the joints (n,) at a phase of the circle in rad."""
        return np.asarray(
            self.centre + self.radius * (np.eye(14)[1] * np.cos(phase) + np.eye(14)[3] * np.sin(phase))
        )

    def rates(self, phase: float) -> Array:
        """Return the change of the joints per rad of the circle."""
        return np.asarray(self.radius * (np.eye(14)[3] * np.cos(phase) - np.eye(14)[1] * np.sin(phase)))

    def ends(self, tableau: Tableau, n: int) -> tuple[Array, float]:
        """Return the rotation vector (3,) of the base after ``n`` steps, and how far the joints miss."""
        robot = self.robot
        q = np.concatenate([np.zeros(6), [1.0], self.joints(0.0)])
        rates = self.pulsation * self.rates(0.0)
        v = np.concatenate([base_twist_per_joint_rate(robot, q) @ rates, rates])

        def acceleration(q: Array, v: Array) -> Array:
            wanted = -(self.pulsation**2) * (q[BASE_NQ:] - self.centre)
            effort = reduced_inverse_dynamics(robot, q, v, wanted)
            return np.array(pin.aba(robot.pin, robot.data, q, v, np.concatenate([np.zeros(BASE_NV), effort])))

        q, v = _advance(robot.pin, tableau, acceleration, (q, v), self.period, n)
        turn = np.array(pin.log3(pin.Quaternion(q[3:BASE_NQ]).matrix()))
        return turn, float(np.max(np.abs(q[BASE_NQ:] - self.joints(0.0))))

    def geometric(self, n: int) -> Array:
        """Return the same rotation vector from the path alone, by the Lagrangian's mass matrix.

        Without momentum the base turns at w = -(H_b^-1 H_bm q_m')_w, which the joints decide. Magnus'
        method of order 4 with Gauss' two points integrates R' = R [w x].
        """
        lagrangian = Lagrangian(self.robot.description)
        rotation, step = np.eye(3), 2.0 * np.pi / n
        for index in range(n):
            first, second = (
                self._spin(lagrangian, (index + 0.5 + side * np.sqrt(3.0) / 6.0) * step)
                for side in (-1.0, 1.0)
            )
            mean, twist = (
                step / 2.0 * (first + second),
                np.sqrt(3.0) / 12.0 * step**2 * np.cross(first, second),
            )
            rotation = rotation @ _turn(mean + twist)
        angle = np.arccos((np.trace(rotation) - 1.0) / 2.0)
        skew = (rotation - rotation.T) / (2.0 * np.sin(angle))
        return np.asarray(angle * np.array([skew[2, 1], skew[0, 2], skew[1, 0]]))

    def _spin(self, lagrangian: Lagrangian, phase: float) -> Array:
        """Return the angular velocity of the base in its own axes, per rad of the circle."""
        q = np.concatenate([np.zeros(BASE_NV), self.joints(phase)])
        inertia = lagrangian.motion(q, np.zeros(20)).inertia
        pull = inertia[:BASE_NV, BASE_NV:] @ self.rates(phase)
        return np.array(-np.linalg.solve(inertia[:BASE_NV, :BASE_NV], pull)[3:])


def _turn(vector: Array) -> Array:
    """Return the rotation by a rotation vector, by Rodrigues' formula."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)


def test_a_closed_joint_path_turns_the_base(
    robot: RobotModel, integrator: str, record: Record, table: Table
) -> None:
    """Joints that come back have turned the base by an angle of the path alone."""
    centre = np.tile([0.2, -0.6, 0.1, -1.5, 0.3, -0.8, 0.4], 2)
    expected = Loop(robot, centre, 1.0).geometric(128)
    check = Loop(robot, centre, 1.0).geometric(64)
    own_error = float(np.linalg.norm(expected - check)) / 15.0  # order 4: the finer one is 16 times better
    tableau, counts = TABLEAUS[integrator], [50, 100, 200, 400]
    rows = ["| steps per loop | turn of the base [deg] | off the geometric phase [rad] | joints miss [rad] |"]
    rows.append("|---|---|---|---|")
    errors = []
    for n in counts:
        turn, missed = Loop(robot, centre, 1.0).ends(tableau, n)
        errors.append(float(np.linalg.norm(turn - expected)))
        rows.append(f"| {n} | {np.degrees(np.linalg.norm(turn)):.10f} | {errors[-1]:.1e} | {missed:.1e} |")
    if integrator == "rk4":
        angle = np.degrees(np.linalg.norm(expected))
        rows.append(f"| geometric phase | {angle:.10f} | {own_error:.1e} | 0 |")
        table("A closed path of joints 2 and 4 of arm A, 0.4 rad around, by rk4:\n\n" + "\n".join(rows))
    about = f"closed joint path, {integrator}"
    off = abs(slope([1.0 / n for n in counts], errors) - tableau.order)
    claim = f"{about}: order with which the turn is met, less {tableau.order}"
    record(claim, off, _ORDER_TOLERANCE, against="geometric phase, Lagrangian and Magnus")
    bound = 2.0 * errors[2] / 2.0**tableau.order + own_error
    for period in (1.0, 3.0):
        turn, _ = Loop(robot, centre, period).ends(tableau, 400)
        claim = f"{about}: turn of the base off the geometric phase, 400 steps in {period:g} s"
        found = float(np.linalg.norm(turn - expected))
        record(claim, found, bound, unit="rad", against="geometric phase, Lagrangian and Magnus")
