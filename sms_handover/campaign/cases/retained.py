"""Retained data of a case: its trajectory at the rate of references, or its whole run as arrays or a bag."""

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from sms_handover.campaign.cases.case_row import Row, Task
from sms_handover.campaign.definition.campaign_file import Keep
from sms_handover.campaign.definition.fields import ALL, BAG, FAILURES
from sms_handover.run_data import RunData

TRAJECTORIES, FULL, BAGS = "trajectories", "full", "bags"


def keeps_trajectory(keep: Keep, row: Row) -> bool:
    """Whether the trajectory of a case is kept."""
    return keep.trajectories == ALL or (keep.trajectories == FAILURES and not row.succeeded)


def trajectory(run: RunData) -> bytes:
    """Return a run at the rate of its references, as a NumPy archive."""
    rows = np.searchsorted(run.tick_ns, run.reference_ns)
    stream = BytesIO()
    arrays: dict[str, Any] = dict(
        stamp_ns=run.reference_ns,
        joint_names=np.array(run.joint_names),
        joint_position=run.joint_position[rows],
        joint_velocity=run.joint_velocity[rows],
        joint_command=run.joint_command[rows],
        base_pose=run.base_pose[rows],
        reference_position=run.reference_position,
        deputy_pose=run.deputy_pose,
        **{f"tool_pose.{arm}": pose for arm, pose in run.tool_pose.items()},
        **{f"target_pose.{arm}": pose for arm, pose in run.target_pose.items()},
    )
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


def file_of(folder: Path, kind: str, task: Task) -> Path:
    """Return the NumPy archive of a case."""
    return folder / kind / f"{_name(task)}.npz"


def worst_path(folder: Path, keep: Keep, task: Task) -> Path:
    """Return where a case is if it is kept as one of the worst: a NumPy archive, or the folder of a run."""
    return folder / BAGS / _name(task) if keep.worst_as == BAG else file_of(folder, FULL, task)


def _name(task: Task) -> str:
    """Return the name of a case among files."""
    return f"{task.case}_{task.scenario}_{task.law}"
