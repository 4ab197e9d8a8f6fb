"""Reader of a recorded run into arrays."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sms_handover.bag.info import BagInfo, read_info
from sms_handover.bag.ledger import has_ledger
from sms_handover.bag.run.collector import BASE_POSE, BASE_TWIST, EFFORT, POSITION, VELOCITY, RunCollector
from sms_handover.bag.run.series import Series
from sms_handover.errors import BagError
from sms_handover.frames import arm_of_joint
from sms_handover.graph import topics
from sms_handover.model.hinges import hinges_in
from sms_handover.run_data import Array, MeasuredRows, RunData, Stamps
from sms_handover.types import TaskPhase

_NO_IK = -1  # in RunData.ik_status where no solve was asked
_MOST_NAMES = 8  # topics listed in an error message
_REQUIRED = (topics.JOINT_STATES, topics.BASE_ODOMETRY)


def read_run(path: Path, namespace: str | None = None) -> RunData:
    """Return the run in the bag at ``path``, its folder or its file.

    There is a row per tick for each stamp with joint states and base odometry, and a row per
    reference period for each stamp with a joint reference; what was not recorded at such a stamp
    is NaN. ``phases`` has an entry per reference period. Joints are matched by name, in the order
    of the first joint state. Of a simulation that was reset, only the last run is read.

    ``namespace`` is that of the graph; without it the bag must hold one run only. Raises BagError
    if the bag is missing or damaged, was not closed, or holds no run.
    """
    info = read_info(path)
    collector = RunCollector(info, find_namespace(info) if namespace is None else namespace.rstrip("/"))
    for name in _REQUIRED:
        if collector.full_name(name) not in info.topics:
            raise BagError(
                f"{path} holds no run of sms_handover: it has no topic {collector.full_name(name)}"
            )
    collector.collect()
    return _assemble(collector)


def _assemble(collector: RunCollector) -> RunData:
    names = collector.joints[topics.JOINT_STATES].first_names()
    panel_names, springs = hinges_in(collector.info.urdf_text)
    joint_names = tuple(name for name in names if name not in panel_names)

    def joint(topic: str, block: int, columns: tuple[str, ...]) -> Series:
        return collector.joints[topic].series(block, columns).settled()

    def rows(topic: str) -> Array:
        return collector.rows[topic].series().settled().at(periods)

    def impulse(topic: str) -> Array:
        found = collector.rows[topic].series().settled()
        first_ns = found.stamp_ns[0] if len(found.stamp_ns) else np.inf
        values = found.at(periods)
        values[periods < first_ns] = 0.0  # nothing had acted
        return values

    position = joint(topics.JOINT_STATES, POSITION, joint_names)
    pose = collector.odometry.series(BASE_POSE, 7).settled()
    twist = collector.odometry.series(BASE_TWIST, 6).settled()
    ticks: Stamps = np.intersect1d(position.stamp_ns, pose.stamp_ns)
    reference = joint(topics.JOINT_REFERENCE, POSITION, joint_names)
    periods = reference.stamp_ns
    arms = _by_first_joint(collector.arms, joint_names)
    energy = rows(topics.ENERGY)
    angles = joint(topics.JOINT_STATES, POSITION, panel_names).at(periods)
    return RunData(
        joint_names=joint_names,
        arms=tuple(arms),
        tick_ns=ticks,
        joint_position=position.at(ticks),
        joint_velocity=joint(topics.JOINT_STATES, VELOCITY, joint_names).at(ticks),
        joint_effort=joint(topics.JOINT_STATES, EFFORT, joint_names).at(ticks),
        joint_command=joint(topics.JOINT_COMMAND, EFFORT, joint_names).at(ticks),
        base_pose=pose.at(ticks),
        base_twist=twist.at(ticks),
        reference_ns=periods,
        reference_position=reference.at(periods),
        reference_velocity=joint(topics.JOINT_REFERENCE, VELOCITY, joint_names).at(periods),
        target_pose={arm: rows(topics.target_pose(arm)) for arm in arms},
        tool_pose={arm: rows(topics.tool_pose(arm)) for arm in arms},
        deputy_pose=rows(topics.DEPUTY_POSE),
        deputy_twist=rows(topics.DEPUTY_ODOMETRY),
        linear_momentum=rows(topics.LINEAR_MOMENTUM),
        angular_momentum=rows(topics.ANGULAR_MOMENTUM),
        kinetic_energy=energy[:, 0].copy(),
        work=energy[:, 1].copy(),
        external_work=energy[:, 2].copy(),
        lost=energy[:, 3].copy(),
        elastic_energy=springs.energy(angles),
        panel_position=angles,
        panel_velocity=joint(topics.JOINT_STATES, VELOCITY, panel_names).at(periods),
        panel_names=panel_names,
        applied=collector.applied,
        linear_impulse=impulse(topics.LINEAR_IMPULSE),
        angular_impulse=impulse(topics.ANGULAR_IMPULSE),
        ik_status=np.nan_to_num(rows(topics.IK_STATUS)[:, 0], nan=_NO_IK).astype(np.int64),
        phases=_last_run(collector.phases),
        grasp_events=tuple(collector.events),
        run_events=tuple(collector.run_events),
        plans=tuple(collector.plans),
        base_wrenches=tuple(collector.base_wrenches),
        planned_paths=tuple(collector.planned_paths),
        measured=_measured(collector, joint_names, ticks, periods),
    )


def _measured(
    collector: RunCollector, joint_names: Sequence[str], ticks: Stamps, periods: Stamps
) -> MeasuredRows | None:
    """Return what sensors have told, None if the bag has none of it."""
    joints, odometry = collector.joints[topics.MEASURED_JOINT_STATES], collector.measured_odometry
    if not joints.first_names():
        return None
    deputy = collector.rows[topics.MEASURED_DEPUTY_POSE]
    return MeasuredRows(
        joint_position=joints.series(POSITION, joint_names).settled().at(ticks),
        joint_velocity=joints.series(VELOCITY, joint_names).settled().at(ticks),
        base_pose=odometry.series(BASE_POSE, 7).settled().at(ticks),
        base_twist=odometry.series(BASE_TWIST, 6).settled().at(ticks),
        deputy_pose=deputy.series().settled().at(periods),
    )


def holds_run(info: BagInfo) -> bool:
    """Whether a bag was recorded by this package and holds one run."""
    try:
        find_namespace(info)
    except BagError:
        return False
    return has_ledger(info.records)


def find_namespace(info: BagInfo) -> str:
    """Return the namespace of the only run in a bag, '' for the root."""
    tail = f"/{topics.JOINT_STATES}"
    found = [name.removesuffix(tail) for name in info.topics if name.endswith(tail)]
    runs = [prefix for prefix in found if all(f"{prefix}/{name}" in info.topics for name in _REQUIRED)]
    if not runs:
        raise BagError(
            f"{info.path} holds no run of sms_handover: it needs the topics {' and '.join(_REQUIRED)},"
            f" and has {_listed(list(info.topics))}"
        )
    if len(runs) > 1:
        raise BagError(f"{info.path} holds several runs, name the namespace of one: {', '.join(runs)}")
    return runs[0]


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return (", ".join(names[:_MOST_NAMES]) or "none") + more


def _by_first_joint(arms: Sequence[str], joint_names: Sequence[str]) -> list[str]:
    """Return the arms in the order of their first joints."""
    owners = list(map(arm_of_joint, joint_names))
    return sorted(arms, key=lambda arm: (owners.index(arm) if arm in owners else len(owners), arm))


def _last_run(phases: Sequence[TaskPhase]) -> tuple[TaskPhase, ...]:
    """Return the phases since the last reset, one per stamp, by time."""
    begin = 0
    for place in range(1, len(phases)):
        if phases[place - 1].stamp_ns > phases[place].stamp_ns <= phases[0].stamp_ns:
            begin = place
    by_stamp = {phase.stamp_ns: phase for phase in phases[begin:]}
    return tuple(by_stamp[stamp_ns] for stamp_ns in sorted(by_stamp))
