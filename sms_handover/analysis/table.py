"""Table of a comparison as plain text: metrics, conservation, and the verdicts on the paper's claims."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from math import hypot, isinf, isnan
from textwrap import wrap

from sms_handover.analysis.base_motion import BaseMotion
from sms_handover.analysis.claims import Claim
from sms_handover.analysis.clearance import TaskTexts
from sms_handover.analysis.clearance_rows import clearance_sections
from sms_handover.analysis.comparison import Comparison, compare
from sms_handover.analysis.completion import command_in_words
from sms_handover.analysis.conservation import PhysicsResiduals
from sms_handover.analysis.grasps import Tolerance
from sms_handover.analysis.joints import F
from sms_handover.analysis.layout import MISSING, WIDTH, Row, Section, layout, number, row
from sms_handover.analysis.loop_timing import LoopTiming
from sms_handover.analysis.metrics import PhaseMetrics, RunMetrics
from sms_handover.analysis.numbers import largest, lengths
from sms_handover.analysis.plan_rows import plan_sections
from sms_handover.analysis.tracking import Motion, ToolTracking
from sms_handover.graph.events import Severity
from sms_handover.run_data import RunData
from sms_handover.types import GraspAction, GraspEvent
from sms_handover.units import DEG_PER_RAD, MM_PER_M, ns_to_seconds

_MICRO = 1e6
_MS_PER_S = 1000.0  # [ms/s]
_NEVER = "never"
_cost = partial(row, smaller_is_better=True)
_VERDICTS = {True: "HOLDS", False: "DOES NOT HOLD"}


def comparison_table(
    runs: Mapping[str, RunData],
    *,
    laws: Mapping[str, str] | None = None,
    tolerance: Tolerance | None = None,
    texts: Mapping[str, TaskTexts] | None = None,
) -> str:
    """Return a table of the runs, by name, and the verdicts on the paper's claims if they are a pair.

    ``laws`` has the control law of each run, otherwise it is taken from the name; ``tolerance`` is
    printed beside the values at a grasp. ``texts`` has what each run was made with, for its clearance.
    """
    return render(compare(runs, laws, texts=texts), tolerance)


def render(comparison: Comparison, tolerance: Tolerance | None = None) -> str:
    """Return the table of a comparison."""
    lines = layout(list(comparison.runs), figure_sections(comparison, tolerance))
    if comparison.claims:
        lines += layout(("NMPC", "PID"), [_claim_section(comparison.claims)])
    return "\n".join(lines[1:]) + "\n"


def figure_sections(comparison: Comparison, tolerance: Tolerance | None = None) -> tuple[Section, ...]:
    """Return every figure of a comparison but the claims: completion, grasps, phases, torques, physics."""
    runs = list(comparison.runs.values())
    return (
        Section("Task", _completion_rows(comparison)),
        Section("Grasp events", _grasp_rows(runs, tolerance)),
        *_run_event_section(runs),
        *(_phase_section(comparison, name) for name in comparison.phase_names),
        Section("Torque over the whole run, peak / RMS [N m]", _torque_rows(runs)),
        *clearance_sections(runs),
        *plan_sections(runs),
        Section("Physics and inverse kinematics", _conservation_rows(runs)),
        *([Section("Wall clock", _loop_rows(runs))] if any(item.loop for item in runs) else []),
    )


def _completion_rows(comparison: Comparison) -> tuple[Row, ...]:
    """Return whether each run is complete, and below, run by run, what it lacks."""
    found = {name: run.completion for name, run in comparison.runs.items()}
    rows = [Row("complete", tuple("yes" if item.complete else "no" for item in found.values()))]
    for name, item in found.items():
        unknown = () if item.clearance_known else ("clearance unknown",)
        for text in (*item.shortfalls, *unknown):
            rows += [Row(line) for line in _wrapped(f"  {name}: {text}")]
    return tuple(rows)


def _wrapped(text: str) -> list[str]:
    """Return the lines of a text that is as wide as the table at most."""
    return wrap(text, WIDTH, subsequent_indent="  ", break_on_hyphens=False)


def _grasp_rows(runs: Sequence[RunMetrics], tolerance: Tolerance | None) -> tuple[Row, ...]:
    """Return the outcome of every grasp command, with the errors at which the gripper closed."""
    by_run = [{(event.stamp_ns, event.command): event for event in item.run.grasp_events} for item in runs]
    keys = dict.fromkeys(key for events in by_run for key in events)
    rows = []
    for key in sorted(keys, key=lambda key: key[0]):
        stamp_ns, command = key
        events = [found.get(key) for found in by_run]
        label = f"{ns_to_seconds(stamp_ns):g} s: {command_in_words(command)}"
        rows.append(Row(label, tuple(event.status.value if event else MISSING for event in events)))
        if command.action is not GraspAction.RELEASE:
            rows += [_cost(f"  {label}", events, value) for label, value in _reached(events, tolerance)]
            if any(event and any(event.impulse) for event in events):
                rows += [_cost(f"  {label}", events, value) for label, value in _PASSED_ON]
    return tuple(rows) or (Row("none"),)


def _run_event_section(runs: Sequence[RunMetrics]) -> tuple[Section, ...]:
    """Return the number of warnings and errors of each kind, if the nodes reported any."""
    counts = [
        Counter(
            f"{event.kind} ({event.severity.value})"
            for event in item.run.run_events
            if event.severity is not Severity.INFO
        )
        for item in runs
    ]
    kinds = dict.fromkeys(kind for count in counts for kind in count)
    rows = [Row(kind, tuple(str(count[kind]) for count in counts)) for kind in kinds]
    return (Section("Warnings and errors", tuple(rows)),) if rows else ()


_REACHED: tuple[tuple[str, Callable[[GraspEvent], float], Callable[[Tolerance], float]], ...] = (
    ("distance [mm]", lambda event: event.position_error * MM_PER_M, lambda most: most.position * MM_PER_M),
    ("angle [deg]", lambda event: event.angle_error * DEG_PER_RAD, lambda most: most.angle * DEG_PER_RAD),
    (
        "relative speed [mm/s]",
        lambda event: event.relative_speed * MM_PER_M,
        lambda most: most.speed * MM_PER_M,
    ),
    (
        "relative rate [deg/s]",
        lambda event: event.relative_rate * DEG_PER_RAD,
        lambda most: most.rate * DEG_PER_RAD,
    ),
)
_PASSED_ON: tuple[tuple[str, Callable[[GraspEvent], float]], ...] = (  # with a deputy that has mass
    ("impulse [N s]", lambda event: hypot(*event.impulse[:3])),
    ("angular impulse [N m s]", lambda event: hypot(*event.impulse[3:])),
    ("energy lost [J]", lambda event: event.energy_lost),
)


def _reached(
    events: Sequence[GraspEvent | None], tolerance: Tolerance | None
) -> Iterator[tuple[str, Callable[[GraspEvent], float]]]:
    """Yield the errors at a grasp with what is allowed; older versions did not record the rate."""
    for what, value, limit in _REACHED:
        if any(event and not isnan(value(event)) for event in events) or what != _REACHED[-1][0]:
            judged = tolerance and not isinf(limit(tolerance))
            yield f"{what}, allowed {limit(tolerance):g}" if tolerance and judged else what, value


def _phase_section(comparison: Comparison, name: str) -> Section:
    phases = [item.phase(name) for item in comparison.runs.values()]
    spans = [item.phase for item in phases if item]
    rows: list[Row] = []
    for arm in dict.fromkeys(arm for item in phases if item for arm in item.tools):
        rows += _tool_rows(arm, phases)
    rows.append(Row("base"))
    rows.append(_cost("  position change [mm]", phases, lambda item: item.base.position_change * MM_PER_M))
    rows.append(
        _cost("  attitude change [deg]", phases, lambda item: item.base.attitude_change * DEG_PER_RAD)
    )
    drifts = [drift[name] for drift in comparison.drift.values()]
    begin = largest([drift.begin for drift in drifts])
    since = "no run settles" if isnan(begin) else f"from {number(begin)} s, when the last run has settled"
    rows.append(Row(f"base, drift: {since}"))
    rows += [_cost(label, drifts, value) for label, value in _DRIFT]
    begin_s, end_s = (ns_to_seconds(time_ns) for time_ns in (spans[0].start_ns, spans[0].end_ns))
    return Section(f"Phase {name}, {begin_s:g} to {end_s:g} s", tuple(rows))


_DRIFT: tuple[tuple[str, Callable[[BaseMotion], float]], ...] = (
    ("  position drift [um/s]", lambda drift: drift.position_rate * _MICRO),
    ("  attitude drift [urad/s]", lambda drift: drift.attitude_rate * _MICRO),
    ("  mean speed [um/s]", lambda drift: drift.mean_speed * _MICRO),
    ("  mean turn rate [urad/s]", lambda drift: drift.mean_turn_rate * _MICRO),
)
_MOVING: tuple[tuple[str, Callable[[ToolTracking], float]], ...] = (
    ("  overshoot [mm]", lambda tool: tool.overshoot * MM_PER_M),
    ("  overshoot [% of step]", lambda tool: tool.overshoot_ratio * 100.0),
)
_HELD: tuple[tuple[str, Callable[[ToolTracking], float]], ...] = (
    ("  largest error [mm]", lambda tool: tool.largest_error * MM_PER_M),
)
_EITHER: tuple[tuple[str, Callable[[ToolTracking], float]], ...] = (
    ("  steady-state error [mm]", lambda tool: tool.steady_state_error * MM_PER_M),
    ("  final error [mm]", lambda tool: tool.final_error * MM_PER_M),
    ("  largest angle error [deg]", lambda tool: tool.orientation.largest_error * DEG_PER_RAD),
    ("  final angle error [deg]", lambda tool: tool.final_orientation_error * DEG_PER_RAD),
)


def _of_arm(figures: F, arm: str) -> F | None:
    """Return the figures of one arm, None for a robot without it."""
    found = figures.of_arm(arm)
    return found if found.joint_names else None


def _tool_rows(arm: str, phases: Sequence[PhaseMetrics | None]) -> list[Row]:
    tools = [item.tools.get(arm) if item else None for item in phases]
    torques = [_of_arm(item.torque, arm) if item else None for item in phases]
    works = [_of_arm(item.work, arm) if item else None for item in phases]
    kinds = {tool.motion for tool in tools if tool}
    kind = " or ".join(motion.value for motion in Motion if motion in kinds)
    rows = [Row(f"{arm} ({kind})")]
    if kinds != {Motion.HOLD}:
        rows.append(row("  step length [mm]", tools, lambda tool: tool.step_length * MM_PER_M))
    rows += [_cost(label, tools, value) for label, value in (_HELD if kinds == {Motion.HOLD} else _MOVING)]
    rows.append(_cost("  settling time [s]", tools, lambda tool: tool.settling_time, _NEVER))
    rows += [_cost(label, tools, value) for label, value in _EITHER]
    if any(tool and not isnan(tool.orientation.overshoot) for tool in tools):
        rows.append(
            _cost("  angle overshoot [deg]", tools, lambda tool: tool.orientation.overshoot * DEG_PER_RAD)
        )
    rows.append(
        _cost("  angle settling time [s]", tools, lambda tool: tool.orientation.settling_time, _NEVER)
    )
    rows.append(_cost("  peak torque [N m]", torques, lambda torque: largest(torque.peak)))
    rows.append(_cost("  RMS torque of the arm [N m]", torques, lambda torque: float(lengths(torque.rms))))
    rows.append(_cost("  control effort [(N m)^2 s]", torques, lambda torque: float(torque.effort.sum())))
    rows.append(_cost("  absolute work [J]", works, lambda work: float(work.absolute.sum())))
    return rows


def _torque_rows(runs: Sequence[RunMetrics]) -> tuple[Row, ...]:
    torques = [item.torque for item in runs]
    joints = dict.fromkeys(name for torque in torques for name in torque.joint_names)
    return (
        *(Row(name, tuple(_peak_and_rms(item, name) for item in runs)) for name in joints),
        _cost("absolute work [J]", runs, lambda item: float(item.work.absolute.sum())),
        _cost("control effort [(N m)^2 s]", torques, lambda torque: float(torque.effort.sum())),
        _cost("saturated ticks, worst joint", torques, lambda torque: largest(torque.saturated_ticks)),
        _cost("ticks at the peak, worst joint", torques, lambda torque: largest(torque.ticks_at_peak)),
    )


def _peak_and_rms(metrics: RunMetrics, joint: str) -> str:
    torque = metrics.torque
    if joint not in torque.joint_names:
        return MISSING
    place = torque.joint_names.index(joint)
    return f"{torque.peak[place]:.3g} / {torque.rms[place]:.3g}"


def _conservation_rows(runs: Sequence[RunMetrics]) -> tuple[Row, ...]:
    physics = [item.physics for item in runs]
    return (
        row("largest change of linear momentum [kg m/s]", physics, lambda of: of.linear_momentum),
        row("largest change of angular momentum [kg m^2/s]", physics, lambda of: of.angular_momentum),
        row("largest energy residual / max E [-]", physics, lambda of: of.energy),
        row("peak kinetic energy [J]", physics, lambda of: of.peak_kinetic_energy),
        *(row(label, physics, value) for label, value in _ACCOUNT if any(map(value, physics))),
        row("IK solves", runs, lambda item: float(item.ik.solves)),
        _cost("IK solves that failed", runs, lambda item: float(item.ik.failures)),
    )


_ACCOUNT: tuple[tuple[str, Callable[[PhysicsResiduals], float]], ...] = (
    ("work from outside [J]", lambda physics: physics.external_work),
    ("energy lost [J]", lambda physics: physics.lost),
)
_LOOP: tuple[tuple[str, Callable[[LoopTiming], float]], ...] = (
    ("wall time [s]", lambda loop: loop.wall_duration),
    ("real-time factor [-]", lambda loop: loop.real_time_factor),
    ("plant period, mean [ms]", lambda loop: loop.period_mean * _MS_PER_S),
    ("  standard deviation [ms]", lambda loop: loop.period_std * _MS_PER_S),
    ("  largest [ms]", lambda loop: loop.period_max * _MS_PER_S),
    ("largest lag behind real time [s]", lambda loop: loop.largest_lag),
    ("late ticks", lambda loop: loop.late_ticks),
    ("ticks with an old command", lambda loop: loop.held_commands),
)


def _loop_rows(runs: Sequence[RunMetrics]) -> tuple[Row, ...]:
    loops = [item.loop for item in runs]
    return tuple(row(label, loops, value) for label, value in _LOOP)


def _claim_section(claims: Sequence[Claim]) -> Section:
    """Return every claim: the verdict, the quotation from the paper, and the figures under both laws."""
    held = sum(claim.holds for claim in claims)
    rows: list[Row] = []
    for claim in claims:
        missing = _NEVER if claim.name == "settling" else MISSING
        head = (f"{_VERDICTS[claim.holds]}: {claim.text}", f'  Paper: "{claim.paper}"')
        rows += [Row(""), *(Row(line) for text in head for line in _wrapped(text))]
        rows += [
            Row(f"  {item.label} [{item.unit}]", (number(item.nmpc, missing), number(item.pid, missing)))
            for item in claim.findings
        ]
        rows += [Row(line) for note in claim.notes for line in _wrapped(f"  {note}")]
    return Section(f"Claims of the paper: {held} of {len(claims)} hold", tuple(rows[1:]))
