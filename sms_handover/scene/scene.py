"""Scene of a run: shapes, and the poses of everything at a number of instants."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from types import MappingProxyType

import numpy as np

from sms_handover.clearance.worst_pair import WorstPair
from sms_handover.errors import ConfigurationError
from sms_handover.frames import tool_frame
from sms_handover.run_data import RunData, Stamps
from sms_handover.scene.links import DescribedRobot, moving_joints
from sms_handover.scene.momentum import MASSLESS, Momentum, PointMass, momentum_of
from sms_handover.scene.planned_lines import PlannedLines, planned_lines
from sms_handover.scene.shapes import Shape, read_shapes
from sms_handover.types import Array, GraspEvent, TaskPhase, read_only
from sms_handover.units import NS_PER_S

FRAME_RATE = 25.0  # [1/s] every second reference period of the shipped parameters; viewers interpolate


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything visible at each of T instants; every pose is a row (7,) in ``world``.

    ``stamp_ns`` (T,) is simulation time; ``link_in_world`` (T, L, 7) is in the order of ``links``;
    ``deputy_size`` (3,) m are the edges of the deputy and ``deputy_in_world`` (T, 7) is its centre;
    ``target_in_world`` has (T, 7) per arm. What was not recorded is NaN. ``phases`` has one entry per
    start of a phase. ``worst_pair`` has the two bodies nearest to each other, None if that is unknown,
    ``momentum`` that of robot and deputy, and ``planned`` where plans led the tools, None if there is none;
    ``measured_deputy`` (T, 7) is where sensors have told the deputy to be, None without sensors.
    """

    shapes: tuple[Shape, ...]
    links: tuple[str, ...]
    arms: tuple[str, ...]
    stamp_ns: Stamps
    link_in_world: Array
    deputy_size: Array
    deputy_in_world: Array
    target_in_world: Mapping[str, Array]
    phases: tuple[TaskPhase, ...]
    grasp_events: tuple[GraspEvent, ...]
    worst_pair: WorstPair | None = None
    momentum: Momentum | None = None
    planned: PlannedLines | None = None
    measured_deputy: Array | None = None

    def __post_init__(self) -> None:
        self.stamp_ns.setflags(write=False)
        for name in ("link_in_world", "deputy_size", "deputy_in_world"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        targets = {arm: read_only(poses) for arm, poses in self.target_in_world.items()}
        object.__setattr__(self, "target_in_world", MappingProxyType(targets))

    def link(self, name: str) -> Array:
        """Return the poses (T, 7) of one link."""
        return self.link_in_world[:, self.links.index(name)]

    def tool(self, arm: str) -> Array:
        """Return the poses (T, 7) of the tool frame of an arm; their positions are its trace."""
        return self.link(tool_frame(arm))


def make_scene(
    run: RunData,
    urdf: str,
    deputy_size: Array,
    frame_rate: float = FRAME_RATE,
    worst_pair: WorstPair | None = None,
    deputy: PointMass = MASSLESS,
) -> Scene:
    """Return the scene of a run at about ``frame_rate`` instants per s of simulation time.

    Each instant is a stamp at which both the state and the references were recorded, so every pose is a
    recorded one or follows from the recorded state, and none is interpolated. Raises ConfigurationError
    if there is no such stamp, or the rate is not positive, and UnknownNameError if the description lacks
    a joint of the run.
    """
    stamps = frame_stamps(run, frame_rate)
    robot = DescribedRobot(urdf)
    ticks = np.searchsorted(run.tick_ns, stamps)
    periods = np.searchsorted(run.reference_ns, stamps)
    return Scene(
        shapes=read_shapes(robot.pin, urdf),
        links=robot.links,
        arms=run.arms,
        stamp_ns=stamps,
        link_in_world=robot.poses(run.base_pose[ticks], *moving_joints(run, ticks, periods)),
        deputy_size=deputy_size,
        deputy_in_world=run.deputy_pose[periods],
        target_in_world={arm: poses[periods] for arm, poses in run.target_pose.items()},
        phases=tuple(_beginnings(run.phases)),
        grasp_events=run.grasp_events,
        worst_pair=worst_pair.at(stamps) if worst_pair else None,
        momentum=momentum_of(run, robot, deputy, ticks, periods),
        planned=planned_lines(run.planned_paths, run.arms),
        measured_deputy=run.measured.deputy_pose[periods] if run.measured else None,
    )


def frame_stamps(run: RunData, frame_rate: float) -> Stamps:
    """Return the latest recorded stamps not after an even grid in time, the first and the last included."""
    if not (isfinite(frame_rate) and frame_rate > 0.0):
        raise ConfigurationError(f"frame rate is {frame_rate:g} 1/s, it must be > 0")
    recorded = np.intersect1d(run.tick_ns, run.reference_ns)
    if not recorded.size:
        raise ConfigurationError("the run has no stamp with both a state and a reference: nothing to show")
    step_ns = max(1, round(NS_PER_S / frame_rate))
    grid = np.arange(recorded[0], recorded[-1], step_ns)
    chosen = np.searchsorted(recorded, grid, "right") - 1
    stamps: Stamps = recorded[np.unique(np.append(chosen, recorded.size - 1))]
    return stamps


def _beginnings(phases: tuple[TaskPhase, ...]) -> list[TaskPhase]:
    pairs = zip((None, *phases), phases, strict=False)
    return [phase for before, phase in pairs if before is None or before.index != phase.index]
