"""Animation of the runs in 3D, of those whose bags have what it needs."""

from collections.abc import Sequence
from dataclasses import dataclass

from sms_handover.analysis.clearance import RunClearance
from sms_handover.errors import BagError, SmsHandoverError
from sms_handover.report.recorded_run import RecordedRun
from sms_handover.scene.page import animation_html
from sms_handover.scene.recorded_scene import deputy_in, deputy_size_in
from sms_handover.scene.scene import FRAME_RATE, Scene, make_scene


@dataclass(frozen=True)
class Animation:
    """A page that plays runs, '' if there are none; and one line for each run that it leaves out."""

    html: str
    left_out: tuple[str, ...]


def animation(runs: Sequence[RecordedRun], clearances: Sequence[RunClearance | None]) -> Animation:
    """Return the animation of every run whose bag describes the robot and the deputy.

    The bodies that are nearest to each other are marked in those whose clearance is known.
    """
    scenes: dict[str, Scene] = {}
    left_out: list[str] = []
    for run, clearance in zip(runs, clearances, strict=True):
        try:
            scenes[run.name] = recorded_scene(run, clearance)
        except SmsHandoverError as error:
            left_out.append(f"{run.name} is not shown: {error}")
    return Animation(animation_html(scenes) if scenes else "", tuple(left_out))


def recorded_scene(run: RecordedRun, clearance: RunClearance | None, frame_rate: float = FRAME_RATE) -> Scene:
    """Return the scene of a recorded run, with the bodies nearest to each other if that is known.

    Raises BagError if the bag does not describe robot and deputy.
    """
    urdf = run.info.urdf_text
    if urdf is None:
        raise BagError("its bag carries no robot description")
    series = clearance.series if clearance else None
    worst = series.worst_pair if series else None
    return make_scene(run.data, urdf, deputy_size_in(run.info), frame_rate, worst, deputy_in(run.info))
