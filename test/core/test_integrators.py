"""Each integrator keeps the manifold, reaches its declared order on it, and meets closed forms."""

import numpy as np
import pinocchio as pin
import pytest

from sms_handover.model.robot_model import BASE_NV, RobotModel
from sms_handover.plant.integrators import TABLEAUS, Acceleration, LieGroupIntegrator, Tableau
from sms_handover.types import Array

from .conftest import Draw, distance, slope

_EPS = np.finfo(float).eps
_ORDER_TOLERANCE = 0.1  # [-] what issue 3 asks of a measured order

State = tuple[Array, Array]


def _advance(
    model: pin.Model, tableau: Tableau, rate: Acceleration, start: State, time: float, n: int
) -> State:
    """Return the state after ``time`` s in ``n`` steps."""
    q, v = start
    integrator = LieGroupIntegrator(model, tableau, time / n)
    for _ in range(n):
        q, v = integrator.step(rate, q, v)
    return q, v


def _driven(robot: RobotModel, effort: Array) -> Acceleration:
    """Return the acceleration of the robot under constant efforts of its joints."""
    generalized = np.concatenate([np.zeros(BASE_NV), effort])

    def acceleration(q: Array, v: Array) -> Array:
        return np.array(pin.aba(robot.pin, robot.data, q, v, generalized))

    return acceleration


@pytest.fixture(params=sorted(TABLEAUS))
def tableau(request: pytest.FixtureRequest) -> Tableau:
    """Every integrator that a user can choose."""
    return TABLEAUS[request.param]


def test_tableau_is_consistent(tableau: Tableau) -> None:
    """An explicit scheme: row i has i entries, its origin comes before it, and the weights sum to one."""
    count = len(tableau.a)
    assert [len(row) for row in tableau.a] == list(range(count))
    assert all(origin < max(stage, 1) for stage, origin in enumerate(tableau.origins))
    assert len(tableau.origins) == count and {len(row) for row in tableau.b} == {count}
    assert sum(map(sum, tableau.b)) == pytest.approx(1.0, abs=_EPS)


def test_measured_order_is_the_declared_one(robot: RobotModel, draw: Draw, tableau: Tableau) -> None:
    """The error of a tumbling robot under joint efforts falls with the step to the declared power."""
    start = (draw.q(), draw.v())
    rate = _driven(robot, draw.effort(start[0]))
    time = 0.4  # [s]
    exact = _advance(robot.pin, TABLEAUS["rk4"], rate, start, time, 1600)
    counts = [50, 100, 200]
    errors = [distance(robot, _advance(robot.pin, tableau, rate, start, time, n), exact) for n in counts]
    assert slope([time / n for n in counts], errors) == pytest.approx(tableau.order, abs=_ORDER_TOLERANCE)


def test_a_constant_twist_is_integrated_exactly(robot: RobotModel, draw: Draw, tableau: Tableau) -> None:
    """Without acceleration the base follows one screw and the joints run evenly, in a single step."""
    q, v = draw.q(), draw.v()
    q_next, v_next = LieGroupIntegrator(robot.pin, tableau, 0.5).step(lambda q, v: np.zeros(20), q, v)
    np.testing.assert_allclose(v_next, v, atol=4 * _EPS)
    assert distance(robot, (q_next, v), (pin.integrate(robot.pin, q, 0.5 * v), v)) <= 32 * _EPS


def test_quaternion_stays_normalised(robot: RobotModel, draw: Draw, tableau: Tableau) -> None:
    """The orientation stays on the sphere to rounding, however many steps are taken: nothing drifts off."""
    q, _ = _advance(robot.pin, tableau, _driven(robot, np.zeros(14)), (draw.q(), draw.v()), 0.5, 500)
    assert abs(np.linalg.norm(q[3:7]) - 1.0) <= 4 * _EPS


class Top:
    """A symmetric top, free or falling: its motion is known in closed form.

    Where it falls, its acceleration in its own axes depends on its attitude too.
    """

    def __init__(self, draw: Draw, gravity: float = 0.0) -> None:
        """Spin it about a random axis while it flies along; ``gravity`` in m/s^2 pulls it along -z."""
        self.pull = np.array([0.0, 0.0, -gravity])
        self.across, self.along = 2.0, 3.0  # [kg m^2]
        self.model = pin.Model()
        joint = self.model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "free")
        moments = np.diag([self.across, self.across, self.along])
        self.model.appendBodyToJoint(joint, pin.Inertia(5.0, np.zeros(3), moments), pin.SE3.Identity())
        self.model.gravity.linear = self.pull
        self.data = self.model.createData()
        self.q = np.concatenate([draw.vector(3), pin.Quaternion(pin.exp3(draw.vector(3))).coeffs()])
        self.v = np.concatenate([draw.vector(3), [1.0, -0.7, 1.5]])

    def acceleration(self, q: Array, v: Array) -> Array:
        """Return the acceleration without any effort."""
        return np.array(pin.aba(self.model, self.data, q, v, np.zeros(6)))

    def at(self, time: float) -> State:
        """Return the exact state: R = exp(t L / I1) R0 exp(t w3 (1 - I3 / I1) e3), the centre a parabola."""
        rotation = pin.Quaternion(self.q[3:]).matrix()
        spin = self.v[3:]
        momentum = rotation @ np.array([self.across * spin[0], self.across * spin[1], self.along * spin[2]])
        own = spin[2] * (1.0 - self.along / self.across)
        turned = (
            pin.exp3(time * momentum / self.across) @ rotation @ pin.exp3(np.array([0.0, 0.0, time * own]))
        )
        spin_now = turned.T @ momentum / [self.across, self.across, self.along]
        start = rotation @ self.v[:3]
        speed = start + time * self.pull
        place = self.q[:3] + time * start + 0.5 * time**2 * self.pull
        q = np.concatenate([place, pin.Quaternion(turned).coeffs()])
        return q, np.concatenate([turned.T @ speed, spin_now])

    def error(self, tableau: Tableau, time: float, n: int) -> float:
        """Return how far ``n`` steps end from the exact state."""
        q, v = _advance(self.model, tableau, self.acceleration, (self.q, self.v), time, n)
        q_exact, v_exact = self.at(time)
        apart = np.concatenate([pin.difference(self.model, q_exact, q), v - v_exact])
        return float(np.max(np.abs(apart)))


@pytest.mark.parametrize("gravity", [0.0, 3.0])
def test_closed_form_of_the_top_obeys_euler(draw: Draw, gravity: float) -> None:
    """The closed form that the next test trusts fulfils v' = aba(q, v) and q' = v, by differences."""
    top = Top(draw, gravity)
    step = 1e-5  # [s]
    (q0, v0), (q, v), (q1, v1) = (top.at(0.3 + k * step) for k in (-1, 0, 1))
    # Central differences of functions that oscillate at w < 4 rad/s: w^3 h^2 / 6 w + eps / h.
    bound = 4.0**4 * step**2 / 6.0 + 8 * _EPS / step
    np.testing.assert_allclose((v1 - v0) / (2 * step), top.acceleration(q, v), atol=bound)
    np.testing.assert_allclose(pin.difference(top.model, q0, q1) / (2 * step), v, atol=bound)


@pytest.mark.parametrize("gravity", [0.0, 3.0])
def test_top_follows_its_closed_form(draw: Draw, tableau: Tableau, gravity: float) -> None:
    """A spinning symmetric body precesses as Euler found; the error has the declared order and no floor."""
    top, time = Top(draw, gravity), 2.0
    counts = [100, 200, 400]
    errors = [top.error(tableau, time, n) for n in counts]
    assert slope([time / n for n in counts], errors) == pytest.approx(tableau.order, abs=_ORDER_TOLERANCE)
    at_tick = top.error(tableau, time, 2000)
    expected = errors[-1] * (400 / 2000) ** tableau.order
    assert at_tick <= 1.1 * expected + 2000 * 4 * _EPS  # the law of the order, and rounding of each step


def test_motion_run_backwards_returns(robot: RobotModel, draw: Draw, tableau: Tableau) -> None:
    """With every velocity reversed and the same efforts the robot retraces its way, to the scheme's order."""
    q, v = draw.q(), draw.v()
    rate = _driven(robot, draw.effort(q))
    time, counts, errors = 0.4, [25, 50, 100], []
    for n in counts:
        there = _advance(robot.pin, tableau, rate, (q, v), time, n)
        back = _advance(robot.pin, tableau, rate, (there[0], -there[1]), time, n)
        errors.append(distance(robot, (back[0], -back[1]), (q, v)))
    assert slope([time / n for n in counts], errors) >= tableau.order - _ORDER_TOLERANCE
