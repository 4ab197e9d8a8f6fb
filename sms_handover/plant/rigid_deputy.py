"""Deputy with mass: free, it turns as a rigid body; held, it moves with the tool."""

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from sms_handover.model.conserved import ConservedQuantities
from sms_handover.model.poses import pose_row, se3_of
from sms_handover.plant.deputy import DeputyMotion, MasslessDeputy
from sms_handover.plant.integrators import TABLEAUS, LieGroupIntegrator
from sms_handover.types import BASE_NQ, BASE_NV, Array, Pose, Twist, frozen, read_only

_SCHEME = "rk4"  # keeps the energy of a tumbling body to rounding over a run


class RigidDeputy(MasslessDeputy):
    """A deputy of inertia Y: free, Y V' = V x* Y V on SE(3), without wrenches.

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
        self._integrator = LieGroupIntegrator(self._model, TABLEAUS[_SCHEME], h)
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
        """Move freely over one tick; at rest it stays where it is, to the bit."""
        if self.rests:
            return
        self._set(*self._integrator.step(self._acceleration, self._q, self._v))

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
