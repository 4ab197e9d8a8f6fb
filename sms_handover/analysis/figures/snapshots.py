"""Snapshots of the handover (figure 3 of the paper shows the planned sequence)."""

from collections.abc import Sequence
from math import radians

import numpy as np
import pinocchio as pin
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from sms_handover.analysis.figures.drawn_run import DrawnRun
from sms_handover.analysis.figures.schedule import in_print
from sms_handover.analysis.figures.solids import Camera, faces_of, picture_of
from sms_handover.analysis.figures.style import COLOURS, MUTED, PAGE
from sms_handover.errors import ConfigurationError
from sms_handover.frames import BASE
from sms_handover.model.poses import se3_of
from sms_handover.scene.scene import Scene
from sms_handover.types import Array, Pose
from sms_handover.units import ns_to_seconds

COLUMNS = 4
_WIDTH = 0.96 * PAGE / COLUMNS  # [in] of a snapshot
_TITLE = 0.24  # [in] height of its title
_UNDER_WAY = 0.125  # [-] of a phase, when its motion is under way
_MARGIN = 0.15  # [m] around arms and deputy
_CAMERA = Camera(radians(60.0), radians(40.0))
_LIGHT = np.array([0.48, -0.36, 0.8])  # unit vector towards the sun
_DEPUTY, _ARMS = COLOURS[2], COLOURS[:2] + COLOURS[3:]
_PALE = 0.45  # [-] share of white in the colour of an arm, so that its trace stands out

Colour = tuple[float, float, float]


def draw_snapshots(run: DrawnRun) -> Figure:
    """Return the snapshots of one run: its start, then each phase under way and at its end.

    Raises ConfigurationError for a run without a scene.
    """
    scene = run.scene
    if scene is None:
        raise ConfigurationError(f"run {run.name!r} has no scene, so there are no snapshots of it")
    frames = _frames(scene)
    rows = -(-(len(frames) + 1) // COLUMNS)
    low, high = _window(scene, frames)
    height = _WIDTH * float((high - low)[1] / (high - low)[0]) + _TITLE
    figure = Figure(figsize=(PAGE, rows * height))
    panels: list[Axes] = list(figure.subplots(rows, COLUMNS, squeeze=False).flat)
    for axes, frame, before in zip(panels, frames, [frames[0], *frames], strict=False):
        _draw_robot(axes, scene, frame)
        _draw_traces(axes, scene, before, frame)
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        axes.set_aspect("equal")
        axes.set_title(_title(scene, frame), pad=3.0)
        axes.tick_params(left=False, bottom=False, labelleft=False, labelbottom=False)
        axes.grid(visible=False)
    for axes in panels[len(frames) :]:
        axes.set_axis_off()
    _add_key(panels[len(frames)], scene.arms, run.name)
    return figure


def _frames(scene: Scene) -> list[int]:
    """Return the rows of the scene to show, in the order of time."""
    starts = [phase.stamp_ns for phase in scene.phases]
    last = int(scene.stamp_ns[-1])
    times = [int(scene.stamp_ns[0])]
    for start, end in zip(starts, [*starts[1:], last], strict=False):
        times += [start + round(_UNDER_WAY * (end - start)), end]
    times.append(last)
    nearest = [int(np.argmin(np.abs(scene.stamp_ns - time))) for time in times]
    return list(dict.fromkeys(nearest))


def _draw_robot(axes: Axes, scene: Scene, frame: int) -> None:
    """Draw spacecraft, arms and deputy as the camera sees them."""
    colours, solids = [], []
    for shape in scene.shapes:
        placement = _placement(scene.link(shape.link)[frame]) * se3_of(shape.pose_in_link)
        solids.append([_moved(face, placement) for face in faces_of(shape.kind, shape.size)])
        colours.append(_colour(scene, shape.link, shape.rgba[:3]))
    if np.all(np.isfinite(scene.deputy_in_world[frame])):
        placement = _placement(scene.deputy_in_world[frame])
        size = tuple(scene.deputy_size.tolist())
        solids.append([_moved(face, placement) for face in faces_of("box", size)])
        colours.append(to_rgb(_DEPUTY))
    picture = picture_of(solids, _CAMERA, _LIGHT)
    shades = picture.brightness[:, np.newaxis] * np.array(colours)[list(picture.solid)]
    axes.add_collection(PolyCollection(picture.corners, facecolors=shades, edgecolors=shades, linewidths=0.6))


def _draw_traces(axes: Axes, scene: Scene, before: int, frame: int) -> None:
    """Draw the path of each tool since the previous snapshot."""
    for place, arm in enumerate(scene.arms):
        trace = _CAMERA.seen(scene.tool(arm)[before : frame + 1, :3])
        axes.plot(*trace.T, color=_of_arm(place), linewidth=1.0, gid=f"{arm}/trace")


def _window(scene: Scene, frames: list[int]) -> tuple[Array, Array]:
    """Return the lower left and upper right corner (2,) m of all snapshots: arms and deputy fit in."""
    arms = [place for place, link in enumerate(scene.links) if link != BASE]
    places = np.concatenate(
        [scene.link_in_world[frames][:, arms, :3].reshape(-1, 3), scene.deputy_in_world[frames, :3]]
    )
    seen = _CAMERA.seen(places[np.all(np.isfinite(places), axis=1)])
    low: Array = seen.min(axis=0) - _MARGIN
    high: Array = seen.max(axis=0) + _MARGIN
    return low, high


def _title(scene: Scene, frame: int) -> str:
    """Return the time of a snapshot and the phase that has just ended, or is in progress."""
    stamp_ns = int(scene.stamp_ns[frame])
    running = [phase for phase in scene.phases if phase.stamp_ns < stamp_ns] or scene.phases[:1]
    name = running[-1].name if running else ""
    if not name:
        return f"{ns_to_seconds(stamp_ns):g} s"
    ended = stamp_ns in {phase.stamp_ns for phase in scene.phases[1:]} | {int(scene.stamp_ns[-1])}
    words = f"end of {name}" if ended else name
    return f"{ns_to_seconds(stamp_ns):g} s: {words if frame else 'start'}"


def _add_key(axes: Axes, arms: Sequence[str], title: str) -> None:
    """Show in an empty panel the meaning of the colours and the directions of the world axes."""
    handles: list[Patch | Line2D] = [
        Patch(color=_pale(_of_arm(place)), label=in_print(arm)) for place, arm in enumerate(arms)
    ]
    handles.append(Patch(color=_DEPUTY, label="deputy"))
    handles.append(Line2D([], [], color=MUTED, linewidth=1.0, label="path of a tool"))
    axes.legend(handles=handles, title=title, loc="upper left", borderpad=0.0)
    origin = (0.82, 0.4)
    for name, (right, up) in zip("xyz", 0.2 * _CAMERA.seen(np.eye(3)), strict=True):
        axes.annotate(
            "",
            (origin[0] + right, origin[1] + up),
            origin,
            xycoords="axes fraction",
            arrowprops={"arrowstyle": "->", "color": MUTED, "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0},
        )
        behind = (origin[0] + 1.35 * right, origin[1] + 1.35 * up)
        axes.annotate(f"${name}$", behind, xycoords="axes fraction", ha="center", va="center")


def _colour(scene: Scene, link: str, described: Colour) -> Colour:
    """Return the colour of a link: that of its arm, or what the description says."""
    of_link = [arm for arm in scene.arms if link.startswith(f"{arm}_")]
    arm = max(of_link, key=len, default=None)  # that of arm_b_link_1 is arm_b, not arm
    return _pale(described if arm is None else _of_arm(scene.arms.index(arm)))


def _of_arm(place: int) -> str:
    """Return the colour of an arm by its index: not that of the deputy, however many arms there are."""
    return _ARMS[place % len(_ARMS)]


def _pale(colour: str | Colour) -> Colour:
    """Return a colour mixed with white."""
    red, green, blue = (1.0 - (1.0 - _PALE) * (1.0 - part) for part in to_rgb(colour))
    return red, green, blue


def _placement(row: Array) -> pin.SE3:
    """Return a pose row (7,) as a transformation."""
    return se3_of(Pose(row[:3], row[3:]))


def _moved(points: Array, placement: pin.SE3) -> Array:
    """Return points (K, 3) transformed by a placement."""
    return np.asarray(points @ placement.rotation.T + placement.translation)
