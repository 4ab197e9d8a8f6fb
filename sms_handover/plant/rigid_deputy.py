"""Deputy with mass: free, it turns as a rigid body; held, it moves with the tool."""

from collections.abc import Mapping
from math import floor

import numpy as np
import pinocchio as pin

from sms_handover.conditions.wrench import BodyAtInstant, Wrench
from sms_handover.model.conserved import ConservedQuantities
from sms_handover.model.poses import pose_row, se3_of
from sms_handover.plant.deputy import DeputyMotion, MasslessDeputy
from sms_handover.plant.external_wrenches import (
    Acting,
    Companion,
    ExternalAccount,
    WrenchStepper,
    companion_of,
)
from sms_handover.plant.held_body import body_at
from sms_handover.plant.integrators import TABLEAUS, LieGroupIntegrator
from sms_handover.types import BASE_NQ, BASE_NV, Array, Pose, Twist, frozen, read_only

_SCHEME = "rk4"  # keeps the energy of a tumbling body to rounding over a run
_WHOLE = 1e-9  # [-] of a step, below which a duration is a whole number of them
_NO_EFFORT = np.zeros(0)  # of a body without joints


class RigidDeputy(MasslessDeputy):
    """A deputy of inertia Y: free, Y V' = V x* Y V + w on SE(3), under a wrench w or none.

    Its state while it floats is ``q`` (7,), position and quaternion x y z w in ``world``, and the twist
    ``v`` (6,) in its own axes, integrated by a Lie-group scheme of order 4 with the tick as step.
    """

    def __init__(
        self,
        deputy_in_world: Pose,
        grasp_frames: Mapping[str, Pose],
        inertia: pin.Inertia,
        h: float,
        twist_in_world: Twist | None = None,
    ) -> None:
        """Place it at time zero; ``h`` s is the tick."""
        self.inertia = inertia
        self._model = pin.Model()
        self._model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "deputy")
        self._model.appendBodyToJoint(1, inertia, pin.SE3.Identity())
        self._model.gravity.setZero()
        self._data = self._model.createData()
        self._h = h
        self._integrator = LieGroupIntegrator(self._model, TABLEAUS[_SCHEME], h)
        self._under_wrench = WrenchStepper(self._model, self._data, TABLEAUS[_SCHEME], h)
        super().__init__(deputy_in_world, grasp_frames, twist_in_world)
        self._set(pose_row(deputy_in_world), self._v)

    @property
    def twist_in_deputy(self) -> Array:
        """The twist (6,) in its own axes while it floats, linear then angular."""
        return self._v

    @property
    def motion(self) -> DeputyMotion:
        """Everything that its later motion depends on."""
        motion = super().motion
        return DeputyMotion(
            motion.start, motion.twist, motion.drifted_s, motion.holder, motion.in_tool, self._q, self._v
        )

    def restore(self, motion: DeputyMotion) -> None:
        """Go back to a former :attr:`motion`."""
        super().restore(motion)
        if not motion.holder:
            self._set(motion.q, motion.v)

    def let_go(self, twist_in_deputy: Array) -> None:
        """Float from the present pose on with a twist (6,) in its own axes."""
        self._set(pose_row(self.state.deputy_in_world), twist_in_deputy)

    def drift(self, duration: float) -> None:
        """Move freely over ``duration`` s, tick by tick and what is left; at rest it stays, to the bit."""
        if self.rests:
            return
        steps = floor(duration / self._h + _WHOLE)
        for _ in range(steps):
            self._set(*self._integrator.step(self._acceleration, self._q, self._v))
        rest = duration - steps * self._h
        if rest > _WHOLE * self._h:
            last = LieGroupIntegrator(self._model, TABLEAUS[_SCHEME], rest)
            self._set(*last.step(self._acceleration, self._q, self._v))

    def drift_under(self, wrench: Wrench, before: ExternalAccount, robot: Companion) -> ExternalAccount:
        """Move over one tick under a wrench held in ``world`` axes, and return the account after it.

        ``robot`` is the companion of the deputy, as the tick began.
        """
        start = (self._q, self._v)
        end = self._under_wrench.step(*start, _NO_EFFORT, Acting(wrench, None))
        self._set(*end)
        return self._under_wrench.given(start, end, before, robot)

    @property
    def body(self) -> BodyAtInstant:
        """The deputy as a body that wrenches act on, while it floats."""
        return body_at(pin.XYZQUATToSE3(self._q), self.inertia)

    def as_companion(self, force: Array) -> Companion:
        """Return the deputy beside the robot, while it floats, with the force (3,) N that acts on it."""
        return companion_of(self._model, self._data, (self._q, self._v), force)

    @property
    def conserved(self) -> ConservedQuantities:
        """Momenta, energy and centre of mass while it floats."""
        momentum = pin.computeCentroidalMomentum(self._model, self._data, self._q, self._v)
        linear, angular = np.array(momentum.linear), np.array(momentum.angular)
        energy = 0.5 * float(self._v.dot(self.inertia.matrix()).dot(self._v))
        centre = np.array(self._data.com[0])
        return ConservedQuantities(frozen(linear), frozen(angular), frozen(centre), energy)

    def _place(self, pose: pin.SE3, twist: Twist) -> None:
        """Begin to move from a pose with a twist in ``world`` axes."""
        super()._place(pose, twist)
        turn = pose.rotation.T
        self._q = read_only(pin.SE3ToXYZQUAT(pose))
        self._v = read_only(np.concatenate([turn @ twist.linear, turn @ twist.angular]))

    def _set(self, q: Array, v: Array) -> None:
        """Float at ``q`` with the twist ``v``, both kept to the bit."""
        pose = Pose(q[:3], q[3:BASE_NQ])
        placed = se3_of(pose)
        twist = Twist(placed.rotation @ v[:3], placed.rotation @ v[3:BASE_NV])
        super()._place(placed, twist)
        self._q, self._v, self._carried = read_only(q), read_only(v), pose

    def _acceleration(self, q: Array, v: Array) -> Array:
        """Return v' (6,)."""
        result: Array = pin.aba(self._model, self._data, q, v, np.zeros(BASE_NV))
        return result
