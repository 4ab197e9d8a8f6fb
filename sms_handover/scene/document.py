"""JSON document of a scene, for the scripts of the page."""

import base64
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from sms_handover.clearance.worst_pair import WorstPair
from sms_handover.frames import DEPUTY
from sms_handover.model.poses import pose_row
from sms_handover.run_data import Stamps
from sms_handover.scene.momentum import Momentum
from sms_handover.scene.planned_lines import PlannedLines
from sms_handover.scene.scene import Scene
from sms_handover.scene.shapes import Shape
from sms_handover.types import Array, GraspAction, GraspEvent, TaskPhase
from sms_handover.units import NS_PER_S, ns_to_seconds

Document = dict[str, object]

_MEASURED = f"{DEPUTY}/measured"  # a body of the page


def scene_document(name: str, scene: Scene) -> Document:
    """Return a whole scene with the name of its run."""
    blocks = [scene.link_in_world, scene.deputy_in_world[:, None]]
    blocks += [scene.target_in_world[arm][:, None] for arm in scene.arms]
    measured = scene.measured_deputy
    if measured is not None:
        blocks.append(measured[:, None])
    return {
        **still_document(
            name, scene.shapes, scene.links, scene.arms, scene.deputy_size, measured=measured is not None
        ),
        **moving_document(scene.stamp_ns, np.concatenate(blocks, axis=1)),
        **task_document(scene.phases, scene.grasp_events),
        **({"clearance": _clearance(scene.worst_pair)} if scene.worst_pair else {}),
        **({"momentum": _momentum(scene.momentum)} if scene.momentum else {}),
        **({"planned": planned_document(scene.planned)} if scene.planned else {}),
    }


def still_document(
    name: str,
    shapes: Sequence[Shape],
    links: Sequence[str],
    arms: Sequence[str],
    deputy_size: Array,
    *,
    measured: bool = False,
) -> Document:
    """Return the static part: the bodies, in the order of their poses, and their shapes.

    With ``measured`` the last one is the deputy where sensors have told it to be.
    """
    return {
        "name": name,
        "arms": list(arms),
        "bodies": [*links, DEPUTY, *(f"{arm}/target" for arm in arms), *([_MEASURED] if measured else [])],
        "shapes": [_shape(shape) for shape in shapes],
        "deputy_size": deputy_size.tolist(),
    }


def moving_document(stamp_ns: Stamps, poses: Array) -> Document:
    """Return instants (T,) and, in single precision, the poses of all bodies (T, bodies, 7)."""
    return {"times": _base64(stamp_ns / NS_PER_S, "<f8"), "poses": _base64(poses, "<f4")}


def task_document(phases: Sequence[TaskPhase], events: Sequence[GraspEvent]) -> Document:
    """Return the starts of the phases and the outcomes of the grasp commands."""
    return {
        "phases": [{"name": phase.name, "start": ns_to_seconds(phase.stamp_ns)} for phase in phases],
        "events": [{"time": ns_to_seconds(event.stamp_ns), "text": _outcome(event)} for event in events],
    }


def planned_document(planned: PlannedLines) -> Document:
    """Return the instants (P,) s of plans, and their lines (P, A, K, 3) m with K points each."""
    return {
        "times": _base64(planned.stamp_ns / NS_PER_S, "<f8"),
        "points": _base64(planned.points, "<f4"),
        "size": planned.points.shape[2],
    }


def _clearance(worst: WorstPair) -> Document:
    """Return, per instant, the index of the worst pair (T,), its distance (T,) m and points (T, 2, 3) m."""
    used, index = np.unique(worst.pair, return_inverse=True)
    return {
        "pairs": [" - ".join(worst.bodies[pair]) for pair in used.tolist()],
        "pair": _base64(index, "<u2"),
        "distances": _base64(worst.distance, "<f4"),
        "points": _base64(worst.points_in_world, "<f4"),
    }


def _momentum(momentum: Momentum) -> Document:
    """Return, per instant, the centre of mass (T, 3) m and the angular momentum (T, 3) kg m^2/s."""
    return {
        "centres": _base64(momentum.centre_of_mass, "<f4"),
        "angular": _base64(momentum.angular_momentum, "<f4"),
    }


def _shape(shape: Shape) -> Document:
    return {
        "link": shape.link,
        "kind": shape.kind,
        "size": shape.size,
        "pose": pose_row(shape.pose_in_link).tolist(),
        "rgba": [round(part, 6) for part in shape.rgba],
    }


def _outcome(event: GraspEvent) -> str:
    """Return the outcome of a grasp command in one line."""
    command = event.command
    what = f"{command.arm} lets go"
    if command.action is not GraspAction.RELEASE:
        what = f"{command.arm} takes {command.grasp_frame}"
    if command.action is GraspAction.TRANSFER:
        what += f" from {command.from_arm}"
    return f"{ns_to_seconds(event.stamp_ns):g} s: {what}: {event.status.value}"


def _base64(values: npt.ArrayLike, kind: str) -> str:
    """Return numbers as base64 of their bytes."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
