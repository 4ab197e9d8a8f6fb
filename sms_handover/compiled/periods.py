"""Reference periods in C: as many as there are while nothing has to be decided, in one call."""

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np

from sms_handover.compiled.c_function import NativeFunction
from sms_handover.compiled.effects import GIVEN
from sms_handover.compiled.inverse_kinematics import STATUSES, ik_settings
from sms_handover.compiled.kinematics import (
    CONSERVED_SIZE,
    POSE,
    POSE_ROW,
    TWIST,
    numbers_in,
    quantities_of,
    sums_of,
)
from sms_handover.compiled.library import dynamics_library
from sms_handover.compiled.names import PERIODS
from sms_handover.compiled.ticks import CompiledTicks
from sms_handover.ik.parameters import IkParameters
from sms_handover.model.poses import pose_row, twist_in_deputy
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.deputy import MasslessDeputy
from sms_handover.plant.rigid_deputy import RigidDeputy
from sms_handover.trajectory.generator import Course
from sms_handover.types import Array, JointReference, PeriodRows, Pose, TickRows, Twist, read_only
from sms_handover.units import ns_to_seconds

Failures = tuple[int, int]
Room = Callable[[int], Array]  # where the rows (13 + 4 n,) of so many ticks are to be written
_HOLD, _JOINTS, _TOOL, _ON_DEPUTY = range(4)  # how an arm is led, as in native/periods.c


class CompiledPeriods:
    """Carries out reference periods in which nothing has to be decided.

    The state lives in plant and controller, as for :class:`~sms_handover.compiled.ticks.CompiledTicks`.
    """

    def __init__(self, ticks: CompiledTicks, known: RobotModel, ik: IkParameters, per_period: int) -> None:
        """Load the loop; a period has ``per_period`` ticks. Raises ConfigurationError."""
        self._ticks, self._arms, self._per_period = ticks, known.arms, per_period
        self._settings = ik_settings(known, ik)
        n, arms = known.n_joints, len(known.arms)
        self._quiet = np.zeros((), _quiet(n, arms))
        self._layout = _period(n, arms)
        pointer, number = ctypes.c_void_p, ctypes.c_long
        kinds = (pointer, number, *[pointer] * 5, number, number)
        libraries = dynamics_library(known), dynamics_library(ticks.plant.robot)
        self._call = NativeFunction(libraries[0], PERIODS, kinds, libraries[1])

    def run(
        self,
        course: Course,
        before: JointReference,
        first_ns: int,
        deputy: MasslessDeputy,
        failed: Failures,
        room: Room | None = None,
    ) -> tuple[TickRows, PeriodRows, int]:
        """Carry out at most the periods of a course, all of them integrated, from a time on.

        ``before`` is the reference of the period before; ``failed`` the failures of inverse kinematics in a
        row so far, and the number at which the periods end, 0 for never. Ticks are written to ``room``, by
        default to a new array. Returns ticks, periods, and the failures then.
        """
        quiet, count = self._quiet, len(course.progress)
        self._set(course, before, deputy, failed)
        quiet["period_s"] = ns_to_seconds(first_ns - before.stamp_ns)
        periods, progress = np.zeros(count, self._layout), np.ascontiguousarray(course.progress)
        ticks = self._ticks
        rows = (room or ticks.room)(count * self._per_period)
        ticks.take_over(count * self._per_period)
        given = tuple(array.ctypes.data for array in (self._settings, quiet, progress, periods, rows))
        done = self._call(*ticks.address, *given, count, self._per_period)
        steps = done * self._per_period
        ticks.give_back(steps)
        if deputy.holder:
            pose, twist = read_only(quiet["deputy"]), read_only(quiet["deputy_twist"])
            deputy.carry(Pose(pose[:3], pose[3:]), Twist(twist[:3], twist[3:]))
        found = ticks.rows_of(rows[:steps], first_ns)
        return found, self._rows(periods[:done], found), int(quiet["failures"])

    def _set(self, course: Course, before: JointReference, deputy: MasslessDeputy, failed: Failures) -> None:
        """Say what holds for all of the periods."""
        quiet = self._quiet
        for index, arm in enumerate(self._arms):
            quiet["kind"][index] = _JOINTS if arm in course.by_joints else _HOLD
            if arm in course.goals or arm in course.on_deputy:
                quiet["starts"][index] = pose_row(course.starts[arm])
            if arm in course.goals:
                quiet["kind"][index], quiet["goals"][index] = _TOOL, pose_row(course.goals[arm])
            elif arm in course.on_deputy:
                quiet["kind"][index] = _ON_DEPUTY
                quiet["in_deputy"][index] = numbers_in(course.on_deputy[arm])
        quiet["joints"], quiet["ends"], quiet["rates"] = course.joints, course.ends, before.velocity
        quiet["damping"], quiet["has_momentum"] = course.damping, course.has_momentum
        quiet["holder"] = self._arms.index(deputy.holder) if deputy.holder else -1
        quiet["in_tool"] = numbers_in(deputy.in_tool)
        quiet["deputy"] = pose_row(deputy.state.deputy_in_world)
        quiet["deputy_twist"] = deputy.state.twist_deputy_in_world.row
        quiet["failures"], quiet["most_failures"] = failed

    def _rows(self, periods: Any, ticks: TickRows) -> PeriodRows:
        """Return periods by name."""
        plant, conserved = self._ticks.plant, periods["conserved"]
        resisted = plant.effects is not None
        if isinstance(plant.deputy_body, RigidDeputy) and not plant.deputy_body.holder:
            for sums in conserved:
                sums[:] = sums_of(plant.with_deputy(quantities_of(np.array(sums))))
        return PeriodRows(
            stamp_ns=ticks.stamp_ns[:: self._per_period],
            reference_position=periods["reference"],
            reference_velocity=periods["rates"],
            target_pose={arm: periods["targets"][:, index] for index, arm in enumerate(self._arms)},
            tool_pose={arm: periods["tools"][:, index] for index, arm in enumerate(self._arms)},
            deputy_pose=periods["deputy"],
            deputy_twist=twist_in_deputy(periods["deputy"], periods["deputy_twist"]),
            linear_momentum=conserved[:, :3],
            angular_momentum=conserved[:, 3:6],
            kinetic_energy=conserved[:, 9],
            work=periods["work"],
            external_work=periods["given"][:, 6] if resisted else np.full(len(periods), plant.external_work),
            lost=periods["lost"] if resisted else np.full(len(periods), plant.losses),
            linear_impulse=periods["given"][:, :3],
            angular_impulse=periods["given"][:, 3:6],
            ik_status=tuple(None if k < 0 else STATUSES[k] for k in periods["status"].astype(int).tolist()),
        )


def _quiet(joints: int, arms: int) -> Any:
    """Return the fields of ``quiet_t`` in native/periods.c."""
    reals: dict[str, Any] = {"starts": (arms, POSE_ROW), "goals": (arms, POSE_ROW)}
    reals |= {"in_deputy": (arms, POSE), "joints": joints, "ends": joints, "rates": joints}
    reals |= {"in_tool": POSE, "deputy": POSE_ROW, "deputy_twist": TWIST, "damping": (), "period_s": ()}
    counts: dict[str, Any] = {"kind": arms, "holder": (), "failures": (), "most_failures": ()}
    counts |= {"has_momentum": ()}
    fields = [(name, "f8", shape) for name, shape in reals.items()]
    return np.dtype([*fields, *((name, "i8", shape) for name, shape in counts.items())])


def _period(joints: int, arms: int) -> Any:
    """Return the fields of ``period_t`` in native/periods.c."""
    poses = (arms, POSE_ROW)
    reals: dict[str, Any] = {"reference": joints, "rates": joints, "targets": poses, "tools": poses}
    reals |= {
        "deputy": POSE_ROW,
        "deputy_twist": TWIST,
        "conserved": CONSERVED_SIZE,
        "work": (),
        "lost": (),
        "given": GIVEN,
        "status": (),
    }
    return np.dtype([(name, "f8", shape) for name, shape in reals.items()])
