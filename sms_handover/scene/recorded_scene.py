"""Scene of a recorded run, from its bag alone."""

from pathlib import Path

from sms_handover.bag.info import BagInfo, read_info
from sms_handover.bag.run.reader import read_run
from sms_handover.errors import BagError, ScheduleError
from sms_handover.scene.momentum import PointMass
from sms_handover.scene.scene import FRAME_RATE, Scene, make_scene
from sms_handover.trajectory.schedule_text import deputy_mass, deputy_size
from sms_handover.types import Array


def read_scene(path: Path, frame_rate: float = FRAME_RATE) -> Scene:
    """Return the scene of the bag at ``path``, its folder or its file.

    Raises BagError if the bag cannot be read, holds no run, or lacks the robot description or the
    schedule with the size of the deputy.
    """
    info = read_info(path)
    if info.urdf_text is None:
        raise BagError(f"{path} carries no robot description, so there is nothing to draw")
    size, deputy = deputy_size_in(info), deputy_in(info)
    return make_scene(read_run(path), info.urdf_text, size, frame_rate, deputy=deputy)


def deputy_in(info: BagInfo) -> PointMass:
    """Return what the deputy weighs, from the schedule in a bag; raises BagError."""
    try:
        return PointMass(*deputy_mass(info.schedule_text or ""))
    except ScheduleError as error:
        raise BagError(f"{info.path} carries no schedule with the mass of the deputy: {error}") from error


def deputy_size_in(info: BagInfo) -> Array:
    """Return the edges (3,) m of the deputy from the schedule in a bag; raises BagError."""
    try:
        return deputy_size(info.schedule_text or "")
    except ScheduleError as error:
        raise BagError(f"{info.path} carries no schedule with the size of the deputy: {error}") from error
