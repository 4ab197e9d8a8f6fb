"""Claims of the paper about its two control laws, each with the figures that decide it."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import inf, isnan, nan

from sms_handover.analysis.base_motion import BaseMotion
from sms_handover.analysis.completion import collisions_in_words
from sms_handover.analysis.grasps import Hold, holds
from sms_handover.analysis.metrics import RunMetrics, common_settling
from sms_handover.analysis.numbers import largest
from sms_handover.analysis.tracking import Motion, ToolTracking
from sms_handover.run_data import RunData
from sms_handover.types import GraspAction
from sms_handover.units import DEG_PER_RAD, MM_PER_M, ns_to_seconds

GRASP_BY = 20.0  # [s] the paper: "at t = 20 s, manipulator A, having just grasped the deputy"
HANDOVER_AT = 40.0  # [s] start of the last third of the paper's 60 s
HANDOVER_WITHIN = 0.1  # [s] tolerance about HANDOVER_AT
FINAL_ANGLE = 2.0 / DEG_PER_RAD  # [rad] from the final pose; the distance must be in the settling band
LATE_PART = 0.75  # [-] of a phase, after which a transient has decayed
DRIFT_RATIO = 10.0  # [-] our reading of "drift" against "this issue is not present"
PEAK_TORQUE = (1.2, 2.6)  # [N m] our reading of "around 2.0"
FINAL_ERROR = 1e-3  # [m] our reading of "can achieve the desired pose"

_MICRO = 1e6


@dataclass(frozen=True)
class Finding:
    """One figure that decides a claim, for both laws; NaN where it is not defined."""

    label: str
    unit: str
    nmpc: float
    pid: float


@dataclass(frozen=True)
class Claim:
    """One claim: what is compared, the quotation from the paper, the figures, and the verdict.

    ``notes`` has what else decided it, in words.
    """

    name: str
    text: str
    paper: str
    findings: tuple[Finding, ...]
    holds: bool
    notes: tuple[str, ...] = ()


def judge(nmpc: RunMetrics, pid: RunMetrics) -> tuple[Claim, ...]:
    """Return the paper's claims, judged on one run under each law."""
    return (
        _completion(nmpc, pid),
        _overshoot(nmpc, pid),
        _settling(nmpc, pid),
        _drift(nmpc, pid),
        _peak_torque(nmpc, pid),
        _final_error(nmpc, pid),
    )


def _completion(nmpc: RunMetrics, pid: RunMetrics) -> Claim:
    outcomes = (_outcome(nmpc), _outcome(pid))
    rows = (
        ("A holds the deputy from", "s"),
        ("deputy passes from A to B at", "s"),
        ("B at the end: distance to its target", "mm"),
        ("B at the end: angle to its target", "deg"),
        ("collisions", "-"),
        ("least clearance beyond what is allowed", "mm"),
    )
    findings = tuple(
        Finding(label, unit, outcomes[0].values[place], outcomes[1].values[place])
        for place, (label, unit) in enumerate(rows)
    )
    return Claim(
        "completion",
        f"Both laws complete the handover: A holds the deputy by {GRASP_BY:g} s, it passes from A to B at "
        f"{HANDOVER_AT:g} s, and B, holding it, ends settled on its final pose; no bodies enter each other "
        "outside declared contacts.",
        "Both controllers successfully completed the mission objective",
        findings,
        all(outcome.complete for outcome in outcomes),
        (*_clearance_notes("NMPC", nmpc), *_clearance_notes("PID", pid)),
    )


def _clearance_notes(law: str, metrics: RunMetrics) -> tuple[str, ...]:
    """Return the worst collision of a run in words, or that nothing is known of them."""
    if metrics.clearance is None:
        return (f"{law}: clearance unknown, the run does not say what robot and schedule it had",)
    found = collisions_in_words(metrics.clearance)
    if len(found) > 1:
        return (f"{law}: {len(found)} collisions, the worst: {found[0]}",)
    return tuple(f"{law}: {text}" for text in found)


@dataclass(frozen=True)
class _Outcome:
    """What came of a handover: the figures of the claim, in the order of its findings, and the verdict."""

    values: tuple[float, float, float, float, float, float]
    complete: bool


def _outcome(metrics: RunMetrics) -> _Outcome:
    """Return how far a run got with the first handover that was commanded."""
    arms, changes = _giver_and_taker(metrics.run), holds(metrics.run.grasp_events)
    collisions, margin = _collisions(metrics)
    if len(arms) <= 1 or not metrics.phases:
        return _Outcome((nan, nan, nan, nan, collisions, margin), complete=False)
    giver, taker = arms
    grasped = _time_of(changes, lambda change: change.holder == giver)
    passed = _time_of(changes, lambda change: change.holder == taker and change.giver in {giver, ""})
    tool = metrics.phases[-1].tools[taker]
    complete = (
        grasped <= GRASP_BY
        and abs(passed - HANDOVER_AT) <= HANDOVER_WITHIN
        and changes[-1].holder == taker
        and not isnan(tool.settling_time)
        and tool.final_orientation_error <= FINAL_ANGLE
        and not collisions > 0.0  # NaN where the bodies are unknown
    )
    final = (tool.final_error * MM_PER_M, tool.final_orientation_error * DEG_PER_RAD)
    return _Outcome((grasped, passed, *final, collisions, margin), complete)


def _collisions(metrics: RunMetrics) -> tuple[float, float]:
    """Return how many groups of bodies collide, and the least margin in mm; NaN where it is unknown."""
    if metrics.clearance is None:
        return nan, nan
    least = min((group.margin for group in metrics.clearance.groups), default=nan)
    return float(len(metrics.clearance.collisions)), least * MM_PER_M


def _giver_and_taker(run: RunData) -> list[str]:
    """Return the first arms, two at most, that are commanded to hold the deputy."""
    done = (event.command for event in run.grasp_events)
    scheduled = (command for phase in run.phases for command in phase.commands)
    holding = (item for item in (*done, *scheduled) if item.action is not GraspAction.RELEASE)
    arms = dict.fromkeys(arm for item in holding for arm in (item.from_arm, item.arm) if arm in run.arms)
    return list(arms)[:2]


def _time_of(changes: Iterable[Hold], wanted: Callable[[Hold], bool]) -> float:
    """Return the time in s of the first change that is wanted, NaN if there is none."""
    return next((ns_to_seconds(change.since_ns) for change in changes if wanted(change)), nan)


def _overshoot(nmpc: RunMetrics, pid: RunMetrics) -> Claim:
    findings = _per_motion(nmpc, pid, "mm", lambda tool: tool.overshoot * MM_PER_M)
    return Claim(
        "overshoot",
        "In every motion of a tool, PID goes further past the target than NMPC.",
        "the PID controller, using non-optimized gain, exhibited greater overshoot",
        findings,
        _all_larger(findings),
    )


def _settling(nmpc: RunMetrics, pid: RunMetrics) -> Claim:
    findings = _per_motion(nmpc, pid, "s", lambda tool: tool.settling_time)
    return Claim(
        "settling",
        "In every motion of a tool, PID settles later than NMPC.",
        "[PID] exhibited [...] longer settling times than NMPC",
        findings,
        _all_larger(findings, undefined=inf),
    )


def _drift(nmpc: RunMetrics, pid: RunMetrics) -> Claim:
    """Judge whether the base drifts under PID but not under NMPC, once the tools have settled.

    The window of a phase is the same for both laws: from when every tool has settled under both to the
    end of the phase. The rate is the net change over all windows divided by their total length.
    """
    begins = {name: common_settling((nmpc, pid), name) for name in _common_phases(nmpc, pid)}
    settled = _drift_pairs(nmpc, pid, begins)
    late = {name: max(begin, LATE_PART * _duration(nmpc, name)) for name, begin in begins.items()}
    at_last = _drift_pairs(nmpc, pid, late)
    findings = [Finding(f"{name}: settled after", "s", *(m.begin for m in settled[name])) for name in settled]
    ratios = []
    for what, unit, change in (
        ("position", "um/s", "position_change"),
        ("attitude", "urad/s", "attitude_change"),
    ):
        for name, pair in settled.items():
            findings.append(_drift_rate(f"{what}, {name}, since then", unit, [pair], change))
        overall = _drift_rate(f"{what}, all windows together", unit, settled.values(), change)
        late_part = f"{what}, last {1.0 - LATE_PART:.0%} of the phases"
        findings += [overall, _drift_rate(late_part, unit, at_last.values(), change)]
        ratios.append(overall.pid > 0.0 and overall.pid >= DRIFT_RATIO * overall.nmpc)
    return Claim(
        "drift",
        f"After all tools have settled under both laws, the base drifts at least {DRIFT_RATIO:g} times as "
        "fast under PID as under NMPC, in position and in attitude (all windows together).",
        "In the case of the PID controller, the base spacecraft experiences drift after the "
        "end-effectors reach their goal poses. [...] This issue is not present with the NMPC controller.",
        tuple(findings),
        all(ratios),
    )


_Pair = tuple[BaseMotion, BaseMotion]


def _drift_pairs(nmpc: RunMetrics, pid: RunMetrics, begins: Mapping[str, float]) -> dict[str, _Pair]:
    """Return the motions of the base under both laws, for the phases in which both settle."""
    pairs = {name: (nmpc.drift(name, begin), pid.drift(name, begin)) for name, begin in begins.items()}
    return {name: pair for name, pair in pairs.items() if not any(isnan(m.duration) for m in pair)}


def _drift_rate(label: str, unit: str, pairs: Iterable[_Pair], change: str) -> Finding:
    """Return the sum of the net changes divided by the sum of the durations, in 1e-6 of SI units."""
    rates = []
    for motions in zip(*pairs, strict=True):
        total = sum(getattr(motion, change) for motion in motions)
        rates.append(_MICRO * total / sum(motion.duration for motion in motions))
    return Finding(label, unit, *(rates or (nan, nan)))


def _duration(metrics: RunMetrics, name: str) -> float:
    """Return the duration in s of a phase, NaN if the run has none of that name."""
    found = metrics.phase(name)
    return found.phase.duration if found is not None else nan


def _peak_torque(nmpc: RunMetrics, pid: RunMetrics) -> Claim:
    low, high = PEAK_TORQUE
    finding = Finding(
        "largest torque of any joint", "N m", largest(nmpc.torque.peak), largest(pid.torque.peak)
    )
    return Claim(
        "peak_torque",
        f"The largest torque of any joint is about 2 N m under each law ({low:g} to {high:g}).",
        "The maximum joint torque used by either controller is around 2.0 Nm.",
        (finding,),
        all(low <= value <= high for value in (finding.nmpc, finding.pid)),
    )


def _final_error(nmpc: RunMetrics, pid: RunMetrics) -> Claim:
    worst = [
        largest([tool.final_error for phase in run.phases for tool in phase.tools.values()])
        for run in (nmpc, pid)
    ]
    return Claim(
        "final_error",
        f"Under NMPC every tool is within {FINAL_ERROR * MM_PER_M:g} mm of its target at the end of every "
        "phase.",
        "The manipulators are given extra time for each tasks to ensure they can achieve the desired pose",
        (Finding("largest distance at the end of a phase", "mm", *(value * MM_PER_M for value in worst)),),
        worst[0] < FINAL_ERROR,
    )


def _common_phases(nmpc: RunMetrics, pid: RunMetrics) -> list[str]:
    return [item.phase.name for item in nmpc.phases if pid.phase(item.phase.name) is not None]


def _per_motion(
    nmpc: RunMetrics, pid: RunMetrics, unit: str, value: Callable[[ToolTracking], float]
) -> tuple[Finding, ...]:
    """Return a figure for every phase and arm in which the tool moves under both laws."""
    findings = []
    for name in _common_phases(nmpc, pid):
        tools: list[Mapping[str, ToolTracking]] = [
            item.tools for item in (nmpc.phase(name), pid.phase(name)) if item is not None
        ]
        for arm in nmpc.run.arms:
            both = [each[arm] for each in tools if arm in each and each[arm].motion is not Motion.HOLD]
            if len(both) == len(("nmpc", "pid")):
                findings.append(Finding(f"{name}, {arm}", unit, *map(value, both)))
    return tuple(findings)


def _all_larger(findings: Iterable[Finding], undefined: float = nan) -> bool:
    """Whether PID has the larger value in every finding, with ``undefined`` for NaN, and there is one."""
    pairs = [[undefined if isnan(value) else value for value in (item.nmpc, item.pid)] for item in findings]
    return bool(pairs) and all(pid > nmpc for nmpc, pid in pairs)
