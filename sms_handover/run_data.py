"""Run data: one run as arrays, from a simulation or a bag alike."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from sms_handover.graph.events import RunEvent
from sms_handover.plan_report import PlannedPaths, PlanReport
from sms_handover.types import BaseWrench, GraspEvent, TaskPhase

Array = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class MeasuredRows:
    """What sensors have told of a run, and the truth of what none measures; shapes and frames as in RunData.

    There are rows per tick but for ``deputy_pose``, which has one per reference period.
    """

    joint_position: Array
    joint_velocity: Array
    base_pose: Array
    base_twist: Array
    deputy_pose: Array

    def __post_init__(self) -> None:
        for item in fields(self):
            getattr(self, item.name).setflags(write=False)


@dataclass(frozen=True, eq=False)
class RunData:
    """One run: a row per tick (N of them), and a row per reference period (M of them).

    Rows per tick: ``tick_ns`` (N,); joint arrays (N, n) in the order of ``joint_names``, where
    ``joint_effort[k]`` acted over the tick that ended at ``tick_ns[k]`` and ``joint_command[k]``
    answers the state of that stamp; ``base_pose`` (N, 7) position then quaternion x y z w of
    ``base_link`` in ``world``; ``base_twist`` (N, 6) linear then angular in ``base_link`` axes.

    Rows per reference period: ``reference_ns`` (M,); reference position and velocity (M, n); per arm
    ``target_pose`` and ``tool_pose`` (M, 7) in ``world``; ``deputy_pose`` (M, 7), and ``deputy_twist`` (M, 6)
    in axes of the deputy; momentum (M, 3) of robot and deputy in ``world`` axes, the angular one about the
    common centre of mass; ``kinetic_energy`` (M,) J, which grows by ``work`` of the joint efforts and
    ``external_work`` of wrenches from outside, less ``lost`` to heat, each (M,) J since the start;
    ``elastic_energy`` (M,) J of the springs of panels on hinges counts to the same balance; their angles
    ``panel_position`` (M, p) rad and rates ``panel_velocity`` (M, p) rad/s are in the order of
    ``panel_names``. ``linear_impulse`` (M, 3) N s and ``angular_impulse`` (M, 3) N m s are what those have
    added to the momenta, 0 where there were none; ``ik_status`` (M,) the number of the IkStatus message, -1
    where none was asked. Bags of older versions have no deputy twist (NaN), and their work is less what
    joint stops have taken. ``plans`` has the reports of a predictive law, one per solve, and
    ``planned_paths`` those of the tools, of every fifth; ``base_wrenches`` what others have asked for and
    acted, each with the stamp of its tick; ``measured`` is None where no sensor was simulated. ``applied`` is
    JSON of what acted in the plant, as it was read back from it: conditions and inertias; '' in bags of older
    versions.
    """

    joint_names: tuple[str, ...]
    arms: tuple[str, ...]
    tick_ns: Stamps
    joint_position: Array
    joint_velocity: Array
    joint_effort: Array
    joint_command: Array
    base_pose: Array
    base_twist: Array
    reference_ns: Stamps
    reference_position: Array
    reference_velocity: Array
    target_pose: Mapping[str, Array]
    tool_pose: Mapping[str, Array]
    deputy_pose: Array
    deputy_twist: Array
    linear_momentum: Array
    angular_momentum: Array
    kinetic_energy: Array
    work: Array
    external_work: Array
    lost: Array
    elastic_energy: Array
    panel_position: Array
    panel_velocity: Array
    linear_impulse: Array
    angular_impulse: Array
    ik_status: npt.NDArray[np.int64]
    phases: tuple[TaskPhase, ...]
    grasp_events: tuple[GraspEvent, ...]
    run_events: tuple[RunEvent, ...] = ()
    plans: tuple[PlanReport, ...] = ()
    base_wrenches: tuple[BaseWrench, ...] = ()
    panel_names: tuple[str, ...] = ()
    applied: str = ""
    planned_paths: tuple[PlannedPaths, ...] = ()
    measured: MeasuredRows | None = None

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
            elif isinstance(value, Mapping):
                for array in value.values():
                    array.setflags(write=False)
                object.__setattr__(self, item.name, MappingProxyType(dict(value)))
