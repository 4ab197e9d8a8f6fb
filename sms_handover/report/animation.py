"""Animation of the runs in 3D, of those whose bags have what it needs."""

from collections.abc import Sequence
from dataclasses import dataclass

from sms_handover.errors import SmsHandoverError
from sms_handover.report.recorded_run import RecordedRun
from sms_handover.scene.page import animation_html
from sms_handover.scene.recorded_scene import deputy_size_in
from sms_handover.scene.scene import Scene, make_scene


@dataclass(frozen=True)
class Animation:
    """A page that plays runs, '' if there are none; and one line for each run that it leaves out."""

    html: str
    left_out: tuple[str, ...]


def animation(runs: Sequence[RecordedRun]) -> Animation:
    """Return the animation of every run whose bag describes the robot and the deputy."""
    scenes: dict[str, Scene] = {}
    left_out: list[str] = []
    for run in runs:
        urdf = run.info.urdf_text
        if urdf is None:
            left_out.append(f"{run.name} is not shown: its bag carries no robot description")
            continue
        try:
            scenes[run.name] = make_scene(run.data, urdf, deputy_size_in(run.info))
        except SmsHandoverError as error:
            left_out.append(f"{run.name} is not shown: {error}")
    return Animation(animation_html(scenes) if scenes else "", tuple(left_out))
