"""Near pairs: distances between bodies as a control law uses them, with the joints that carry them."""

from sms_handover.clearance.bodies import BodyKind
from sms_handover.clearance.contacts import may_touch
from sms_handover.clearance.distances import ClearanceModel
from sms_handover.control.protocol import NearPair
from sms_handover.types import Array, Pose


class NearPairs:
    """The pairs of a clearance model by names, joints and declarable contacts, and their distances."""

    def __init__(self, model: ClearanceModel) -> None:
        """Tell the pairs of a model, which is only used."""
        self._model = model
        self.pairs = tuple(
            NearPair(
                (one.name, other.name),
                joints,
                (one.arm or other.arm) if may_touch(one, other) else "",
                BodyKind.DEPUTY in (one.kind, other.kind),
                bool(one.arm) and one.arm == other.arm,
            )
            for (one, other), joints in zip(model.pairs, model.joints, strict=True)
        )

    def distances(self, q: Array, deputy_in_world: Pose) -> Array:
        """Return the signed distance (pairs,) m of every pair at a configuration (7 + n,)."""
        return self._model.distances(q, deputy_in_world)

    def nearest(self, pair: int) -> tuple[Array, Array]:
        """Return where a pair was nearest in the last call: points (2, 3) m and normal (3,) in ``world``."""
        found = self._model.nearest_points(pair)
        return found.points_in_world, found.normal_in_world
