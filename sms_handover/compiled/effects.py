"""Effects of conditions that are not ideal in C: steps under friction and wrenches, and ticks with them."""

import ctypes
from typing import Any

import numpy as np
import numpy.typing as npt

from sms_handover.compiled.c_function import NativeFunction
from sms_handover.compiled.example import example_of, require_equal
from sms_handover.compiled.library import dynamics_library
from sms_handover.compiled.names import RESISTED_STEP, SETTLE
from sms_handover.compiled.tree import body_tree, parameters_of
from sms_handover.compiled.wrench_table import WrenchTable
from sms_handover.model.robot_model import BASE_NQ, BASE_NV, RobotModel
from sms_handover.plant.conditioned_stepper import ConditionedStepper, Resistance, ResistedStepper
from sms_handover.plant.effects import PlantEffects
from sms_handover.plant.external_wrenches import Companion, ExternalAccount
from sms_handover.plant.integrators import TABLEAUS, Tableau
from sms_handover.plant.joint_friction import JointFriction
from sms_handover.plant.stepper import PinocchioStepper
from sms_handover.types import Array, BaseWrench, frozen
from sms_handover.units import ns_to_seconds

GIVEN = 7  # numbers of an account: linear and angular impulse, work
_EXAMPLE_NS = 1_000_000  # short, so that rounding is not amplified by a light wrist


class EffectsTable:
    """``effects_t`` of native/effects.c, and what it points to."""

    def __init__(self, joints: int, resistance: Resistance, tick_ns: int) -> None:
        """Fill in what stays from tick to tick; the wrenches are to be of kinds that C has."""
        state = np.zeros((), _layout(joints))
        self.at: dict[str, Any] = {name: state[name] for name in state.dtype.names or ()}
        self.address, self._joints = state.ctypes.data, joints
        self.wrenches = WrenchTable(resistance.wrenches, tick_ns)
        if resistance.friction:
            values = resistance.friction.values
            self.at["viscous"][:], self.at["coulomb"][:] = values.viscous, values.coulomb
            self.at["excess"][:] = values.stiction - values.coulomb
            self.at["slowness"][:] = 1.0 / values.stribeck_speed
        self.at["has_friction"][...] = resistance.friction is not None
        self.at["n_wrenches"][...] = len(self.wrenches)
        self.at["wrenches"][...] = self.wrenches.rows.ctypes.data

    def accompany(self, companion: Companion | None) -> None:
        """Say what floats beside the robot and counts to the same system."""
        if companion is None:
            self.at["companion"][:] = 0.0
        else:
            row = (np.array([companion.mass]), companion.centre, companion.velocity)
            self.at["companion"][:] = np.concatenate(row)


class TickEffects:
    """The effects of a plant over ticks in C, which are taken over and given back with its state."""

    def __init__(self, effects: PlantEffects, joints: int, tick_ns: int) -> None:
        """Set up the effects of a plant."""
        self._effects, self._joints = effects, joints
        self._table = EffectsTable(joints, effects.resistance, tick_ns)
        at, motor = self._table.at, effects.motor
        at["has_path"][...], at["has_motor"][...] = effects.path is not None, motor is not None
        if motor:
            at["factor"][:], at["offset"][:], at["step"][:] = motor.factor, motor.offset, motor.step
            at["divisor"][:] = motor.divisor
        self._kept: tuple[npt.NDArray[Any], ...] = ()

    @property
    def address(self) -> int:
        """Where ``effects_t`` is."""
        return self._table.address

    def take_over(self, first: int, ticks: int, losses: float, companion: Companion | None) -> None:
        """Take what the effects carry, and draw the numbers of some ticks from a first one on."""
        effects, table, at = self._effects, self._table, self._table.at
        path, motor, external = effects.path, effects.motor, effects.external
        noise = motor.noise(first, ticks) if motor else np.zeros(0)
        dropped = path.losses(first, ticks).astype(np.int64) if path else np.zeros(0, np.int64)
        waiting = np.array(path.state.waiting).reshape(-1, self._joints) if path else np.zeros(0)
        if path:
            at["held"][:], at["delay"][...], at["oldest"][...] = path.state.held, len(waiting), 0
        self._kept = noise, dropped, waiting
        for name, array in zip(("noise", "dropped", "waiting"), self._kept, strict=True):
            at[name][...] = array.ctypes.data
        at["total_lost"][...] = losses
        at["total_given"][:] = row_of(external)
        table.wrenches.tell(first, ticks)
        table.accompany(companion)

    def give_back(self) -> float:
        """Give the effects what the ticks have led to; return the energy lost since the start, in J."""
        at, effects = self._table.at, self._effects
        if effects.path:
            effects.path.hold(np.roll(self._kept[2], -int(at["oldest"]), axis=0), at["held"])
        effects.external = account_of(at["total_given"].copy())
        return float(at["total_lost"])


class CompiledResistedStepper(ResistedStepper):
    """Steps as :class:`~sms_handover.plant.conditioned_stepper.ConditionedStepper`, to rounding."""

    def __init__(self, robot: RobotModel, resistance: Resistance, tableau: Tableau, tick_ns: int) -> None:
        """Load the step, and compare it with Pinocchio; raises ConfigurationError."""
        library, size = dynamics_library(robot), robot.n_joints
        self._scheme, self._start_ns = tuple(TABLEAUS.values()).index(tableau), 0
        shapes = (BASE_NQ + size, BASE_NV + size, size, BASE_NQ + size, BASE_NV + size)
        self._arrays = tuple(map(np.zeros, shapes))
        self._parameters, self._h = parameters_of(body_tree(robot)), np.zeros(1)
        pointer, number = ctypes.c_void_p, ctypes.c_long
        self._step = NativeFunction(library, RESISTED_STEP, (pointer, number, number, *[pointer] * 7))
        self._settle = NativeFunction(library, SETTLE, [pointer] * 5)
        self._at = tuple(array.ctypes.data for array in self._arrays)
        self._numbers_at = self._parameters.ctypes.data, self._h.ctypes.data
        self._use(resistance, _EXAMPLE_NS)
        example, theirs = example_of(robot), _conditioned(robot, resistance, tableau)
        require_equal(library, [*zip(self.step(*example), theirs.step(*example), strict=True)])
        self._use(resistance, tick_ns)

    def _use(self, resistance: Resistance, tick_ns: int) -> None:
        """Step by ticks of ``tick_ns`` from now on."""
        self._table = EffectsTable(self._arrays[2].size, resistance, tick_ns)
        self._tick_ns, self._h[0] = tick_ns, ns_to_seconds(tick_ns)

    def begin(self, start_ns: int, asked: BaseWrench | None = None) -> None:
        """Tell when the next step begins; a wrench that is asked for is not for C."""
        self._start_ns = start_ns

    def step(self, q: Array, v: Array, effort: Array) -> tuple[Array, Array]:
        """Return q (7 + n,) and v (6 + n,) after a step under joint efforts (n,), as read-only arrays."""
        self._arrays[0][:], self._arrays[1][:], self._arrays[2][:] = q, v, effort
        self._table.wrenches.tell(self._start_ns // self._tick_ns, 1)
        given, found = self._at[:3], self._at[3:]
        self._step(self._table.address, self._start_ns, self._scheme, *given, *self._numbers_at, *found)
        return frozen(self._arrays[3].copy()), frozen(self._arrays[4].copy())

    @property
    def lost(self) -> float:
        """Energy in J that friction has taken in the latest step."""
        return float(self._table.at["lost"])

    def given(self, before: ExternalAccount, companion: Companion | None = None) -> ExternalAccount:
        """Return an account of what wrenches have given, after the latest step."""
        if not len(self._table.wrenches):
            return before
        self._table.accompany(companion)
        self._settle(self._table.address, *self._at[3:], *self._numbers_at)
        return account_of(row_of(before) + self._table.at["given"])


def _conditioned(robot: RobotModel, resistance: Resistance, tableau: Tableau) -> ConditionedStepper:
    """Return the steps to compare ours with."""
    h, friction = ns_to_seconds(_EXAMPLE_NS), resistance.friction
    theirs = Resistance(JointFriction(friction.values, h) if friction else None, resistance.wrenches)
    return ConditionedStepper(robot, theirs, PinocchioStepper(robot, tableau, h), tableau, h)


def row_of(account: ExternalAccount) -> Array:
    """Return an account as one array (7,)."""
    return np.concatenate([account.linear_impulse, account.angular_impulse, [account.work]])


def account_of(row: Array) -> ExternalAccount:
    """Return an account by name."""
    return ExternalAccount(row[:3], row[3:6], float(row[6]))


def _layout(joints: int) -> np.dtype[Any]:
    """Return the fields of ``effects_t`` in native/effects.c."""
    by_joint = ("viscous", "coulomb", "excess", "slowness", "factor", "offset", "step", "divisor", "held")
    reals: dict[str, Any] = dict.fromkeys(by_joint, joints)
    reals |= {"companion": 7, "lost": (), "given": GIVEN, "total_lost": (), "total_given": GIVEN, "start": 26}
    names = ("noise", "dropped", "waiting", "wrenches", "delay", "oldest", "n_wrenches")
    flags = ("has_friction", "has_path", "has_motor")
    fields: list[tuple[str, str, Any]] = [(name, "f8", shape) for name, shape in reals.items()]
    return np.dtype([*fields, *((name, "i8", ()) for name in (*names, *flags))])
