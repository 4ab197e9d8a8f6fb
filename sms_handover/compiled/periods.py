"""Reference periods in C: as many as there are while nothing has to be decided, in one call."""

import ctypes
from typing import Any

import numpy as np

from sms_handover.compiled.c_function import NativeFunction
from sms_handover.compiled.inverse_kinematics import STATUSES, ik_settings
from sms_handover.compiled.kinematics import CONSERVED_SIZE, POSE, POSE_ROW, TWIST, numbers_of
from sms_handover.compiled.library import dynamics_library
from sms_handover.compiled.names import PERIODS
from sms_handover.compiled.ticks import CompiledTicks
from sms_handover.ik.parameters import IkParameters
from sms_handover.model.poses import pose_row
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.deputy import MasslessDeputy
from sms_handover.trajectory.generator import Targets
from sms_handover.types import PeriodRows, Pose, TickRows, Twist, read_only


class CompiledPeriods:
    """Carries out reference periods whose targets stand still.

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
        kinds = (pointer, number, pointer, pointer, pointer, pointer, number, number)
        self._call = NativeFunction(dynamics_library(known), PERIODS, kinds)

    def run(
        self, count: int, targets: Targets, deputy: MasslessDeputy, failures: tuple[int, int]
    ) -> tuple[TickRows, PeriodRows, int]:
        """Carry out at most ``count`` periods from the state of the targets, all of them integrated.

        ``failures`` are those of inverse kinematics in a row so far, and the number at which the periods end,
        0 for never. Returns ticks, periods, and the failures then.
        """
        quiet = self._quiet
        self._set(targets, deputy, failures)
        periods = np.zeros(count, self._layout)
        first_ns, ticks = targets.stamp_ns, self._ticks
        rows = ticks.room(count * self._per_period)
        ticks.take_over()
        given = (self._settings.ctypes.data, quiet.ctypes.data, periods.ctypes.data, rows.ctypes.data)
        done = self._call(*ticks.address, *given, count, self._per_period)
        steps = done * self._per_period
        ticks.give_back(steps)
        if deputy.holder:
            pose, twist = read_only(quiet["deputy"]), read_only(quiet["deputy_twist"])
            deputy.carry(Pose(pose[:3], pose[3:]), Twist(twist[:3], twist[3:]))
        found = ticks.rows_of(rows[:steps], first_ns)
        return found, self._rows(periods[:done], found), int(quiet["failures"])

    def _set(self, targets: Targets, deputy: MasslessDeputy, failures: tuple[int, int]) -> None:
        """Say what holds for all of the periods."""
        quiet, led = self._quiet, targets.tool_in_world
        for index, arm in enumerate(self._arms):
            quiet["led"][index] = arm in led
            if arm in led:
                quiet["targets"][index] = pose_row(led[arm])
        quiet["joints"], quiet["rates"] = targets.joint_position, targets.joint_velocity
        quiet["holder"] = self._arms.index(deputy.holder) if deputy.holder else -1
        quiet["in_tool"] = numbers_of(deputy)
        quiet["deputy"] = pose_row(deputy.state.deputy_in_world)
        quiet["failures"], quiet["most_failures"] = failures

    def _rows(self, periods: Any, ticks: TickRows) -> PeriodRows:
        """Return periods by name."""
        conserved = periods["conserved"]
        return PeriodRows(
            stamp_ns=ticks.stamp_ns[:: self._per_period],
            reference_position=periods["reference"],
            reference_velocity=np.broadcast_to(self._quiet["rates"], periods["reference"].shape).copy(),
            target_pose={arm: periods["targets"][:, index] for index, arm in enumerate(self._arms)},
            tool_pose={arm: periods["tools"][:, index] for index, arm in enumerate(self._arms)},
            deputy_pose=periods["deputy"],
            linear_momentum=conserved[:, :3],
            angular_momentum=conserved[:, 3:6],
            kinetic_energy=conserved[:, 9],
            work=periods["work"],
            ik_status=tuple(None if k < 0 else STATUSES[k] for k in periods["status"].astype(int).tolist()),
        )


def _quiet(joints: int, arms: int) -> Any:
    """Return the fields of ``quiet_t`` in native/periods.c."""
    reals: dict[str, Any] = {"targets": (arms, POSE_ROW), "joints": joints, "rates": joints}
    reals |= {"in_tool": POSE, "deputy": POSE_ROW, "deputy_twist": TWIST}
    counts: dict[str, Any] = {"led": arms, "holder": (), "failures": (), "most_failures": ()}
    fields = [(name, "f8", shape) for name, shape in reals.items()]
    return np.dtype([*fields, *((name, "i8", shape) for name, shape in counts.items())])


def _period(joints: int, arms: int) -> Any:
    """Return the fields of ``period_t`` in native/periods.c."""
    poses = (arms, POSE_ROW)
    reals: dict[str, Any] = {"reference": joints, "targets": poses, "tools": poses, "deputy": POSE_ROW}
    reals |= {"conserved": CONSERVED_SIZE, "work": (), "status": ()}
    return np.dtype([(name, "f8", shape) for name, shape in reals.items()])
