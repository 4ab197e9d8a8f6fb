"""Ticks in C: a reference period of the loop in one call, with the bits of Python and compiled dynamics."""

import ctypes
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from sms_handover.compiled.c_function import NativeFunction, address_of
from sms_handover.compiled.effects import TickEffects
from sms_handover.compiled.library import dynamics_library
from sms_handover.compiled.names import EFFORTS, OBSERVE, TICKS
from sms_handover.compiled.tree import PER_BODY, body_tree, parameters_of, tools_of
from sms_handover.compiled.wrench_table import WrenchTable
from sms_handover.control.compensation import CompensatedTorque
from sms_handover.control.controller import JointController
from sms_handover.control.nmpc import NmpcLaw
from sms_handover.control.pid import PidLaw
from sms_handover.control.protocol import Controller
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.plant.integrators import TABLEAUS
from sms_handover.plant.sensed_plant import SensedPlant
from sms_handover.types import Array, TickRows, frozen
from sms_handover.units import ns_to_seconds

_LAWS: Mapping[type, int] = MappingProxyType({NmpcLaw: 0, PidLaw: 1})  # as in native/ticks.c
_UNBOUNDED_NS = -1  # in place of the longest age of a reference
# Functions of the two libraries by their fields, and whether they are those of the model.
_FUNCTIONS: Mapping[str, tuple[str, bool]] = MappingProxyType(
    {
        "efforts_of_model": (EFFORTS, True),
        "ticks_of_truth": (TICKS, False),
        "observe_truth": (OBSERVE, False),
    }
)
_NO_ARM = -1  # in place of the number of the one in whose load truth and model differ


class CompiledTicks:
    """Carries out the ticks of a plant under a joint controller in C.

    The state lives in plant and controller, as by Python; a call takes it over, goes on, and gives it back.
    What is carried counts by parameters that are passed on; the tick of a grasp is carried out by Python.
    Not thread-safe.
    """

    @staticmethod
    def obstacle(plant: FreeFloatingPlant, controller: Controller, known: RobotModel) -> str:
        """Return what C does not have of plant, controller and robot as it is known, '' for nothing."""
        if not isinstance(controller, JointController) or type(controller.law) not in _LAWS:
            return "a law other than nmpc and pid"
        if isinstance(controller.law, NmpcLaw) and isinstance(controller.law.efforts, CompensatedTorque):
            return "a law that compensates for what its model does not know"
        if isinstance(plant, SensedPlant):
            return "sensors"
        if plant.enforces_limits:
            return "enforced joint limits"
        if plant.effects and not WrenchTable.knows(plant.effects.resistance.wrenches):
            return "a wrench of this kind"
        if plant.effects and plant.effects.on_deputy:
            return "wrenches on the deputy"
        if any(plant.base_wrenches):
            return "wrenches from a topic"
        if plant.robot.description.flexible_panels:
            return "panels that swing"
        if (known.joint_names, known.arms) != (plant.robot.joint_names, plant.robot.arms):
            return "a model with other joints than the truth"
        return ""

    def __init__(
        self, plant: FreeFloatingPlant, controller: Controller, known: RobotModel, scheme: str, tick_ns: int
    ) -> None:
        """Load the loop; ``known`` is the robot as the law knows it. Raises ConfigurationError."""
        assert isinstance(controller, JointController)
        true, longest_ns = plant.robot, controller.track.longest_ns
        self.plant, self._controller = plant, controller
        self._scheme = tuple(TABLEAUS).index(scheme)
        self._tick_ns = tick_ns
        self._state = np.zeros((), _layout(true.n_joints))
        self._address = self._state.ctypes.data
        self._at: dict[str, Any] = {name: self._state[name] for name in self._state.dtype.names or ()}
        constant: dict[str, Any] = {
            "limit": known.effort_limit,
            "true_limit": true.effort_limit,
            "tick_s": ns_to_seconds(tick_ns),
            "tick_ns": tick_ns,
            "law": _LAWS[type(controller.law)],
            "longest_ns": _UNBOUNDED_NS if longest_ns is None else longest_ns,
        }
        for name, value in constant.items():
            self._at[name][...] = value
        effects = plant.effects
        self._effects = TickEffects(effects, true.n_joints, tick_ns) if effects else None
        self._at["effects"][...] = self._effects.address if self._effects else 0
        pointer, number = ctypes.c_void_p, ctypes.c_long
        kinds = (pointer, number, pointer, number, number)
        libraries = dynamics_library(true), dynamics_library(known)
        self._call = NativeFunction(libraries[0], TICKS, kinds, libraries[1])
        self._apart = libraries[0] != libraries[1]
        for name, (function, of_model) in _FUNCTIONS.items():
            self._at[name][...] = address_of(libraries[of_model], function)
        self._tool_bodies = [tool.body for tool in tools_of(true)]
        self._use(true, known)
        n = true.n_joints
        self._ends = np.cumsum([BASE_NQ + n, BASE_NV + n, n, n]).tolist()

    def run(self, ticks: int, steps: int) -> TickRows:
        """Carry out ``ticks`` ticks, of which the first ``steps`` are integrated."""
        plant, first_ns, rows = self.plant, self.plant.stamp_ns, self.room(ticks)
        done = 1 if plant.jumps or self._controller.has_news else 0
        if plant.external_impulse and plant.companion and not plant.deputy_body.rests:
            done = ticks  # what floats beside the robot moves the centre that angular impulse is about
        for tick in range(done):
            self._by_python(rows[tick], integrated=tick < steps)
        if done < ticks:
            left = steps - done
            self.take_over(left)
            self._call(*self.address, rows[done:].ctypes.data, ticks - done, left)
            self.give_back(left)
        return self.rows_of(rows, first_ns)

    def _by_python(self, row: Array, *, integrated: bool) -> None:
        """Carry out a tick in which a payload changes, or one that C has not."""
        plant = self.plant
        effort = self._controller.effort(plant.stamp_ns, plant.q, plant.v)
        np.concatenate((plant.q, plant.v, plant.joint_effort, effort), out=row)
        if integrated:
            plant.apply(effort)

    def _use(self, true: RobotModel, known: RobotModel) -> None:
        """Pass on the inertial parameters of the robot in truth, and as it is known."""
        self._robots = true, known
        ours, theirs = (parameters_of(body_tree(robot)) for robot in (true, known))
        self._parameters = ours, theirs
        self._at["true_parameters"][...], self._at["known_parameters"][...] = (
            ours.ctypes.data,
            theirs.ctypes.data,
        )
        different = self._different()
        self._at["one_robot"][...] = not different
        arms = [arm for arm, body in enumerate(self._tool_bodies) if [body] == different]
        self._at["loaded"][...] = arms[0] if arms else _NO_ARM

    def _different(self) -> list[int]:
        """Return the bodies that differ in truth and model; all of them if mounts do."""
        ours, theirs = self._parameters
        end = PER_BODY * (self.plant.robot.n_joints + 1)
        if self._apart or np.any(ours[end:] != theirs[end:]):
            return list(range(end // PER_BODY))
        rows = (ours != theirs)[:end].reshape(-1, PER_BODY)
        return [int(body) for body in np.flatnonzero(np.any(rows, axis=1))]

    @property
    def address(self) -> tuple[int, int]:
        """Where ``ticks_t`` is, and the number of the scheme."""
        return self._address, self._scheme

    def room(self, ticks: int) -> Array:
        """Return room for the rows of some ticks."""
        return np.empty((ticks, self._ends[-1]))

    def rows_of(self, rows: Array, first_ns: int) -> TickRows:
        """Return the rows of ticks from a time on by name."""
        nq, nv, acted, _ = self._ends
        tick_ns = self._tick_ns
        stamps = np.arange(first_ns, first_ns + len(rows) * tick_ns, tick_ns)
        return TickRows(stamps, rows[:, :nq], rows[:, nq:nv], rows[:, nv:acted], rows[:, acted:])

    def take_over(self, steps: int) -> None:
        """Take the state of plant and controller, of which ``steps`` ticks are to be integrated."""
        plant, controller, at = self.plant, self._controller, self._at
        controller.heed_news(plant.stamp_ns)
        law, track, robots = controller.law, controller.track, (plant.loaded_robot, controller.robot)
        if robots[0] is not self._robots[0] or robots[1] is not self._robots[1]:
            self._use(*robots)
        at["q"][:], at["v"][:], at["effort"][:] = plant.q, plant.v, plant.joint_effort
        at["work"][...] = plant.work
        at["stamp_ns"][...] = plant.stamp_ns
        at["motion"][:] = track.motion
        at["reference_ns"][...] = track.stamp_ns
        if isinstance(law, PidLaw):
            at["gains"][:] = (law.gains.proportional, law.gains.integral, law.gains.derivative)
            at["integral"][:] = law.memory
        elif isinstance(law, NmpcLaw):
            at["gains"][:2] = law.feedback[:, 0]
        at["saturated"][:] = 0
        if self._effects:
            self._effects.take_over(plant.tick, steps, plant.losses, plant.companion)

    def give_back(self, steps: int) -> None:
        """Give plant and controller the state that the ticks have led to."""
        plant, law, at = self.plant, self._controller.law, self._at
        q, v, effort = (frozen(at[name].copy()) for name in ("q", "v", "effort"))
        losses = self._effects.give_back() if self._effects else plant.losses
        plant.adopt(steps, q, v, effort, float(at["work"]), losses, at["saturated"])
        if isinstance(law, PidLaw):
            law.restore(at["integral"])


def _layout(joints: int) -> np.dtype[Any]:
    """Return the fields of ``ticks_t`` in native/ticks.c."""
    nq, nv = BASE_NQ + joints, BASE_NV + joints
    reals = {
        **{"q": nq, "v": nv, "effort": joints, "motion": (3, joints), "gains": 3, "integral": joints},
        **{"limit": joints, "true_limit": joints, "tick_s": (), "work": ()},
    }
    names = ("stamp_ns", "reference_ns", "longest_ns", "tick_ns", "law", "one_robot", "loaded")
    pointers = ("true_parameters", "known_parameters", "effects", *_FUNCTIONS)
    counts = {name: () for name in (*names, *pointers)}
    fields: list[tuple[str, str, Any]] = [(name, "f8", shape) for name, shape in reals.items()]
    fields += [(name, "i8", shape) for name, shape in counts.items()]
    return np.dtype([*fields, ("saturated", "i8", joints)])
