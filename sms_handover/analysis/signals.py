"""Signals over time, derived from a run for figures and reports.

A sample that was not recorded is NaN. ``docs/metrics.md`` has the formulas.
"""

from dataclasses import dataclass

import numpy as np

from sms_handover.analysis.joints import joints_of
from sms_handover.analysis.numbers import complete, lengths, rotation_vectors
from sms_handover.errors import ConfigurationError
from sms_handover.run_data import RunData, Stamps
from sms_handover.types import Array
from sms_handover.units import NS_PER_S

AXES = ("x", "y", "z")


@dataclass(frozen=True, eq=False)
class Signal:
    """A quantity over simulation time: ``time`` (N,) s, ``values`` (N, K) in ``unit``, a label per column.

    ``name`` is the name to display. Raises ConfigurationError if the shapes do not match.
    """

    name: str
    unit: str
    time: Array
    values: Array
    labels: tuple[str, ...]

    def __post_init__(self) -> None:
        expected = (*self.time.shape, len(self.labels))
        if self.time.ndim != 1 or self.values.shape != expected:
            raise ConfigurationError(
                f"signal {self.name!r} has values of shape {self.values.shape}, they must be {expected}"
            )
        self.time.setflags(write=False)
        self.values.setflags(write=False)


def position_error(run: RunData, arm: str) -> Signal:
    """Return p - p_d in m, tool less target, in ``world`` axes, each reference period."""
    error = run.tool_pose[arm][:, :3] - run.target_pose[arm][:, :3]
    return _signal(f"position error of {arm}", "m", run.reference_ns, error, AXES)


def orientation_error(run: RunData, arm: str) -> Signal:
    """Return the rotation vector in rad from target to tool, in ``world`` axes."""
    error = rotation_vectors(run.target_pose[arm][:, 3:], run.tool_pose[arm][:, 3:])
    return _signal(f"orientation error of {arm}", "rad", run.reference_ns, error, AXES)


def joint_error(run: RunData, arm: str) -> Signal:
    """Return e = q - q_d in rad of an arm's joints, each reference period, when q_d is updated."""
    joints = joints_of(run.joint_names, arm)
    position = np.full(run.reference_position.shape, np.nan)
    _, ticks, periods = np.intersect1d(run.tick_ns, run.reference_ns, return_indices=True)
    position[periods] = run.joint_position[ticks]
    error = (position - run.reference_position)[:, joints]
    return _signal(f"joint error of {arm}", "rad", run.reference_ns, error, _names(run, joints))


def joint_torque(run: RunData, arm: str) -> Signal:
    """Return the torque in N m of an arm's joints, each tick: the one that acted over the tick that ended."""
    joints = joints_of(run.joint_names, arm)
    return _signal(
        f"joint torque of {arm}", "N m", run.tick_ns, run.joint_effort[:, joints], _names(run, joints)
    )


def base_displacement(run: RunData) -> Signal:
    """Return r(t) - r(0) in m of ``base_link`` in ``world``, each tick."""
    pose = run.base_pose
    change = pose[:, :3] - _first(pose)[:, :3]
    return _signal("base displacement", "m", run.tick_ns, change, AXES)


def base_rotation(run: RunData) -> Signal:
    """Return the rotation vector in rad of Q(t) Q(0)^T, the rotation of ``base_link`` in ``world`` axes."""
    pose = run.base_pose
    change = rotation_vectors(_first(pose)[:, 3:], pose[:, 3:])
    return _signal("base rotation", "rad", run.tick_ns, change, AXES)


def base_speed(run: RunData) -> Signal:
    """Return |v| in m/s of ``base_link``, each tick."""
    return _signal("base speed", "m/s", run.tick_ns, lengths(run.base_twist[:, :3]), ("speed",))


def base_turn_rate(run: RunData) -> Signal:
    """Return |w| in rad/s of ``base_link``, each tick."""
    return _signal("base turn rate", "rad/s", run.tick_ns, lengths(run.base_twist[:, 3:]), ("turn rate",))


def linear_momentum(run: RunData) -> Signal:
    """Return P of robot and deputy in kg m/s in ``world`` axes; constant but for wrenches from outside."""
    return _signal("linear momentum", "kg m/s", run.reference_ns, run.linear_momentum, AXES)


def angular_momentum(run: RunData) -> Signal:
    """Return L in kg m^2/s about the common centre of mass in ``world`` axes; constant likewise."""
    return _signal("angular momentum", "kg m^2/s", run.reference_ns, run.angular_momentum, AXES)


def linear_momentum_change(run: RunData) -> Signal:
    """Return P(t) - P(0) in kg m/s less the impulse from outside, in ``world`` axes; zero up to rounding."""
    own = run.linear_momentum - run.linear_impulse
    change = own - _first(own)
    return _signal("change of linear momentum", "kg m/s", run.reference_ns, change, AXES)


def angular_momentum_change(run: RunData) -> Signal:
    """Return L(t) - L(0) in kg m^2/s about the common centre of mass in ``world`` axes, likewise."""
    own = run.angular_momentum - run.angular_impulse
    change = own - _first(own)
    return _signal("change of angular momentum", "kg m^2/s", run.reference_ns, change, AXES)


def energy(run: RunData) -> Signal:
    """Return kinetic energy, work of the torques and heat in J; work from outside and springs if any."""
    account = {"kinetic energy": run.kinetic_energy, "work": run.work, "lost": run.lost}
    if np.any(np.nan_to_num(run.external_work)):
        account["external work"] = run.external_work
    if run.panel_names:
        account["elastic energy"] = run.elastic_energy
    return _signal("energy", "J", run.reference_ns, np.column_stack(list(account.values())), tuple(account))


def energy_residual(run: RunData) -> Signal:
    """Return E + U - W - X + D less its first value in J, each reference period; zero up to rounding.

    U is the energy of springs, W the work of the torques, X that of wrenches from outside, D what has become
    heat.
    """
    balance = run.kinetic_energy - run.work - run.external_work + run.lost
    if run.panel_names:
        balance = balance + run.elastic_energy
    balance = balance[:, np.newaxis]
    return _signal("energy residual", "J", run.reference_ns, balance - _first(balance), ("residual",))


def signals_of(run: RunData) -> dict[str, Signal]:
    """Return every signal of a run by a key such as ``base_rotation`` or ``arm_a/position_error``."""
    found = {f"{arm}/{one.__name__}": one(run, arm) for arm in run.arms for one in _PER_ARM}
    found.update((one.__name__, one(run)) for one in _OF_ROBOT)
    return found


_PER_ARM = (position_error, orientation_error, joint_error, joint_torque)
_OF_ROBOT = (
    base_displacement,
    base_rotation,
    base_speed,
    base_turn_rate,
    linear_momentum,
    angular_momentum,
    linear_momentum_change,
    angular_momentum_change,
    energy,
    energy_residual,
)


def _signal(name: str, unit: str, stamp_ns: Stamps, values: Array, labels: tuple[str, ...]) -> Signal:
    """Return a signal with integer stamps; the values may be (N,) for a single column."""
    return Signal(name, unit, stamp_ns / NS_PER_S, values.reshape(len(stamp_ns), len(labels)), labels)


def _first(rows: Array) -> Array:
    """Return the first row without NaN, as an array (1, K); NaN if there is none."""
    known = rows[complete(rows)][:1]
    return known if len(known) else np.full((1, rows.shape[1]), np.nan)


def _names(run: RunData, joints: list[int]) -> tuple[str, ...]:
    return tuple(run.joint_names[place] for place in joints)
