"""Outside wrenches of a tick on one robot: those of conditions, on what it holds too, and those asked for."""

from collections.abc import Sequence
from functools import reduce
from operator import add

from sms_handover.conditions.wrench import WrenchModel
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.base_wrenches import in_world
from sms_handover.plant.external_wrenches import Acting, robot_as_body, sum_over
from sms_handover.plant.held_body import HeldBody
from sms_handover.types import Array, BaseWrench


class OutsideWrenches:
    """The wrenches of conditions on a robot, and on the deputy while that is in a hand of it.

    The base feels gravity for the robot with what it holds; where a wrench of the same kind acts on the
    deputy, that acts where the deputy is, and the base feels it for the robot alone.
    """

    def __init__(
        self, robot: RobotModel, base: Sequence[WrenchModel], deputy: Sequence[WrenchModel], h: float
    ) -> None:
        """Find out who feels what; the robot may carry the deputy."""
        self._robot, self._h = robot, h
        carried = robot.carried
        self.held: HeldBody | None = None
        self._of_held: Sequence[WrenchModel] = ()
        self._bare = robot.pin
        apart: set[type] = set()
        if carried and deputy:
            self.held = HeldBody(carried.tool_frame_id, carried.body_in_tool, carried.inertia)
            self._of_held, self._bare = deputy, carried.bare
            apart = {type(model) for model in deputy}
        self._of_whole = [model for model in base if type(model) not in apart]
        self._of_bare = [model for model in base if type(model) in apart]
        self._bare_data = self._bare.createData() if self._of_bare else None
        self._any_on_base = bool(base)

    def over(self, start_s: float, q: Array, v: Array, asked: BaseWrench | None) -> Acting | None:
        """Return what acts over the tick that begins at ``start_s``, None if nothing does."""
        robot, base, held = self._robot, None, None
        if self._any_on_base or asked:
            body = robot_as_body(robot.pin, robot.data, q, v)
            parts = [sum_over(self._of_whole, start_s, self._h, body)] if self._of_whole else []
            if self._bare_data is not None:
                bare = robot_as_body(self._bare, self._bare_data, q, v)
                parts.append(sum_over(self._of_bare, start_s, self._h, bare))
            if asked:
                parts.append(in_world(asked, body.rotation))
            base = reduce(add, parts)
        if self.held:
            body = self.held.as_body(robot.pin, robot.data, q)
            held = sum_over(self._of_held, start_s, self._h, body)
        return Acting(base, held) if base or held else None
