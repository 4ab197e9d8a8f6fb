"""Rows of the comparison table on clearance and on the limits of the joints."""

from collections.abc import Sequence

from sms_handover.analysis.clearance import GroupClearance, RunClearance
from sms_handover.analysis.joint_limits import JointExtreme
from sms_handover.analysis.layout import MISSING, Row, Section
from sms_handover.analysis.metrics import RunMetrics
from sms_handover.units import DEG_PER_RAD, MM_PER_M, ns_to_seconds

_PERCENT = 100.0  # [%]


def clearance_sections(runs: Sequence[RunMetrics]) -> tuple[Section, ...]:
    """Return least distances and the use of joint limits, if the bodies of any run are known."""
    if not any(run.clearance for run in runs):
        return ()
    return (
        Section("Clearance: least signed distance [mm]", _distance_rows([run.clearance for run in runs])),
        Section("Limits of the joints", _limit_rows(runs)),
    )


def _distance_rows(found: Sequence[RunClearance | None]) -> tuple[Row, ...]:
    """Return a row per group of bodies, the one that came nearest in any run first."""
    by_run = [{group.group: group for group in item.groups} if item else {} for item in found]
    worst: dict[str, GroupClearance] = {}
    for group in (group for groups in by_run for group in groups.values()):
        if group.group not in worst or group.margin < worst[group.group].margin:
            worst[group.group] = group
    counts = Row("collisions", tuple(str(len(item.collisions)) if item else MISSING for item in found))
    rows = [
        Row(_label(group), tuple(_distance(groups.get(group.group)) for groups in by_run))
        for group in sorted(worst.values(), key=lambda group: group.margin)
    ]
    return (counts, *rows)


def _label(group: GroupClearance) -> str:
    return f"{group.group} > {group.allowed * MM_PER_M:g}" if group.allowed else group.group


def _distance(group: GroupClearance | None) -> str:
    """Return a distance with its time; a collision is marked."""
    if group is None:
        return MISSING
    mark = " !" if group.collides else ""
    return f"{group.least * MM_PER_M:.2f} at {ns_to_seconds(group.stamp_ns):.2f} s{mark}"


def _limit_rows(runs: Sequence[RunMetrics]) -> tuple[Row, ...]:
    """Return the largest share of a rate limit, the farthest position, and how long joints were beyond."""
    limits = [run.limits for run in runs]
    rates = [item.rate if item else None for item in limits]
    positions = [item.position if item else None for item in limits]
    return (
        Row("largest joint rate [% of its limit]", tuple(_extreme(item, _PERCENT) for item in rates)),
        Row("  time above a rate limit [s]", tuple(_beyond(item) for item in rates)),
        Row(
            "farthest beyond a position limit [deg]", tuple(_extreme(item, DEG_PER_RAD) for item in positions)
        ),
        Row("  time past a position limit [s]", tuple(_beyond(item) for item in positions)),
    )


def _extreme(item: JointExtreme | None, factor: float) -> str:
    """Return the largest value with the joint's name."""
    return f"{item.value * factor:.4g} ({item.joint})" if item else MISSING


def _beyond(item: JointExtreme | None) -> str:
    return f"{item.beyond:g}" if item else MISSING
