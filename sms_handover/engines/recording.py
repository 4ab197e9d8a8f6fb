"""Recording of a run as a replay: which efforts moved which robot from where."""

import numpy as np

from sms_handover.conditions.wrench import WrenchModel
from sms_handover.engines.protocol import Effect, FreeBody, Hold, Replay
from sms_handover.errors import BagError
from sms_handover.plant.base_wrenches import AskedWrenches
from sms_handover.plant.joint_limits import ENFORCE
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import Scenario
from sms_handover.types import GraspAction, GraspEvent, GraspStatus
from sms_handover.units import ns_to_seconds


def replay_of(run: RunData, scenario: Scenario) -> Replay:
    """Return what an engine needs to compute a run of a scenario again.

    States are compared each reference period, where tools and momenta are recorded. Raises BagError where a
    state or an effort is missing, after which nothing could be compared.
    """
    tick_ns = scenario.parameters.common.tick_ns
    _check_complete(run, tick_ns)
    robot = scenario.truth.robot.description
    return Replay(
        urdf=scenario.truth.robot.urdf,
        rotor_inertia=robot.rotor_inertia,
        joint_names=run.joint_names,
        arms=run.arms,
        tick_ns=tick_ns,
        start_q=np.concatenate([run.base_pose[0], run.joint_position[0]]),
        start_v=np.concatenate([run.base_twist[0], run.joint_velocity[0]]),
        efforts=run.joint_effort[1:],
        samples=np.searchsorted(run.tick_ns, run.reference_ns[compared_periods(run)]),
        effects=frozenset(_effects(run, scenario)),
        deputy=_deputy(scenario),
        holds=_holds(run, tick_ns),
        wrenches=_wrenches(run, scenario),
    )


def grasps(run: RunData) -> list[GraspEvent]:
    """Return the events by which a hand took hold of the deputy, in order of time."""
    held = (event for event in run.grasp_events if event.status is GraspStatus.SUCCEEDED)
    return [event for event in held if event.command.action is not GraspAction.RELEASE]


def compared_periods(run: RunData) -> np.ndarray:
    """Return which reference periods begin with a recorded state, as a mask (M,)."""
    return np.isin(run.reference_ns, run.tick_ns)


def _check_complete(run: RunData, tick_ns: int) -> None:
    """Raise BagError unless there is a state and an effort for every tick."""
    gaps = np.flatnonzero(np.diff(run.tick_ns) != tick_ns)
    unknown = np.flatnonzero(np.any(np.isnan(run.joint_effort[1:]), axis=1))
    if run.tick_ns.size < 2 or not np.any(compared_periods(run)):
        raise BagError("the recording has no two states with a reference, so there is nothing to replay")
    if gaps.size or unknown.size:
        first = int(min(*gaps[:1], *unknown[:1], run.tick_ns.size))
        at = ns_to_seconds(int(run.tick_ns[first]))
        raise BagError(
            f"the recording lacks {gaps.size + unknown.size} states or efforts, the first after {at:g} s: "
            "only what moved the robot in every tick can be replayed"
        )


def _deputy(scenario: Scenario) -> FreeBody | None:
    """Return the deputy as it floats at time zero, None without mass."""
    deputy = scenario.truth.schedule.deputy
    if deputy.body is None:
        return None
    return FreeBody(deputy.body, deputy.deputy_in_world, deputy.twist_in_world)


def _holds(run: RunData, tick_ns: int) -> tuple[Hold, ...]:
    """Return what changed between hands and deputy."""
    first = int(run.tick_ns[0])
    return tuple(
        Hold(
            (event.stamp_ns - first) // tick_ns,
            "" if event.command.action is GraspAction.RELEASE else event.command.arm,
        )
        for event in run.grasp_events
        if event.status is GraspStatus.SUCCEEDED
    )


def _wrenches(run: RunData, scenario: Scenario) -> tuple[WrenchModel, ...]:
    """Return the wrenches on the base, those that others have asked for included."""
    of_conditions = tuple(scenario.truth.conditions.wrenches.values())
    if not run.base_wrenches:
        return of_conditions
    return (*of_conditions, AskedWrenches(run.base_wrenches, scenario.parameters.common.tick_ns))


def _effects(run: RunData, scenario: Scenario) -> list[Effect]:
    """Return the effects that a run of a scenario has beyond efforts and links."""
    found = []
    if any(scenario.truth.robot.description.rotor_inertia.values()):
        found.append(Effect.ROTOR_INERTIA)
    if scenario.parameters.plant.joint_limits == ENFORCE:
        found.append(Effect.JOINT_STOPS)
    if scenario.truth.schedule.deputy.mass:
        found.append(Effect.DEPUTY_MASS)
    if scenario.truth.robot.description.flexible_panels:
        found.append(Effect.PANELS)
    conditions = scenario.truth.conditions
    if conditions.wrenches or run.base_wrenches:
        found.append(Effect.WRENCHES)
    if conditions.deputy_wrenches:
        found.append(Effect.DEPUTY_WRENCHES)
    if conditions.friction is not None:
        found.append(Effect.FRICTION)
    return found
