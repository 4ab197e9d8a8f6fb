"""A schedule is read whole, and everything wrong with it is said with the line where it stands."""

import re
from pathlib import Path

import numpy as np
import pytest

from sms_handover.configuration.package_files import config_file
from sms_handover.errors import ConfigurationError, ScheduleError
from sms_handover.model.poses import pose_distance, pose_from_xyz_rpy
from sms_handover.model.robot_model import RobotModel
from sms_handover.simulation.scenario import Scenario
from sms_handover.simulation.wiring import gains_by_phase
from sms_handover.trajectory.load import load_schedule
from sms_handover.trajectory.schedule import (
    GraspFrameTarget,
    Hold,
    JointTarget,
    MissAction,
    OnMiss,
    Schedule,
    ToolTarget,
)
from sms_handover.types import GraspAction, GraspCommand

from .conftest import SCHEDULE, MakeScenario

_PERIOD_NS = 20_000_000
_NS = 1_000_000_000


class Files:
    """Schedules written to a folder and loaded for a robot."""

    def __init__(self, folder: Path, robot: RobotModel) -> None:
        """Keep the folder."""
        self.path = folder / "schedule.yaml"
        self.robot = robot

    def load(self, text: str = SCHEDULE) -> Schedule:
        """Write and load a schedule."""
        self.path.write_text(text, encoding="utf-8")
        return load_schedule(self.path, self.robot, _PERIOD_NS)

    def refusal(self, text: str) -> str:
        """Return the words with which a schedule is refused."""
        with pytest.raises(ConfigurationError) as caught:
            self.load(text)
        assert isinstance(caught.value, ScheduleError) or re.search(
            "not valid YAML|top level", str(caught.value)
        )
        assert "\n" not in str(caught.value)
        return str(caught.value)


def with_policy(policy: str) -> str:
    """Return the schedule with a policy for its second phase."""
    return SCHEDULE.replace("  - name: carry\n", f"  - name: carry\n    {policy}\n")


def line_of(words: str, text: str) -> int:
    """Return the first line that has some words."""
    return next(number for number, line in enumerate(text.splitlines(), 1) if words in line)


@pytest.fixture
def files(tmp_path: Path, robot: RobotModel) -> Files:
    """A folder for one test."""
    return Files(tmp_path, robot)


# --- what is read --------------------------------------------------------------------------------


def test_a_schedule_is_read_as_written(files: Files) -> None:
    """Every number and name of the file stands in the schedule, and the file's text with it."""
    schedule = files.load()
    assert schedule.text == SCHEDULE
    np.testing.assert_array_equal(schedule.initial_joints["arm_b"], [-0.7, -1.7, -1.4, 1.9, -1.6, -1.4, -1.2])
    base = pose_from_xyz_rpy(np.array([0.1, -0.2, 0.3]), np.array([0.0, 0.0, 0.05]))
    assert pose_distance(schedule.base_in_world, base) == (0.0, 0.0)
    assert (schedule.deputy.mass, schedule.deputy.size.tolist()) == (0.0, [0.1, 0.34, 0.1])
    assert list(schedule.deputy.grasp_frames) == ["left", "right"]
    assert [phase.name for phase in schedule.phases] == ["approach", "carry", "withdraw", "let go"]


def test_times_follow_each_other(files: Files) -> None:
    """A phase starts where the one before ends; a motion lasts as long as its phase unless it says so."""
    phases = files.load().phases
    spans = [(phase.start_ns / _NS, phase.end_ns / _NS, phase.motion_ns / _NS) for phase in phases]
    assert spans == [(0.0, 0.4, 0.3), (0.4, 1.0, 0.6), (1.0, 1.2, 0.2), (1.2, 1.4, 0.2)]


def test_every_kind_of_target(files: Files) -> None:
    """Hold, joints, a tool pose in the world, and a pose relative to a grasp frame."""
    approach, carry, withdraw, let_go = files.load().phases
    assert isinstance(approach.targets["arm_b"], Hold)
    frame = approach.targets["arm_a"]
    assert isinstance(frame, GraspFrameTarget)
    assert frame.grasp_frame == "left"
    np.testing.assert_array_equal(frame.tool_in_grasp_frame.position, np.zeros(3))
    np.testing.assert_array_equal(frame.tool_in_grasp_frame.quaternion_xyzw, [0.0, 0.0, 0.0, 1.0])
    tool, joints = carry.targets["arm_a"], withdraw.targets["arm_a"]
    assert isinstance(tool, ToolTarget) and isinstance(joints, JointTarget)
    expected = pose_from_xyz_rpy(np.array([1.15, 0.02, 0.75]), np.array([3.14, -1.5, 0.0]))
    assert pose_distance(tool.tool_in_world, expected) == (0.0, 0.0)
    np.testing.assert_array_equal(joints.position, [0.6, -1.6, 1.3, 1.8, 1.5, -1.3, 1.1])
    offset = let_go.targets["arm_b"]
    assert isinstance(offset, GraspFrameTarget)
    np.testing.assert_array_equal(offset.tool_in_grasp_frame.position, [0.0, 0.0, -0.05])


def test_every_kind_of_event_and_gains(files: Files) -> None:
    """Grasp, transfer and release, each at the first instant of its phase; gains per law."""
    phases = files.load().phases
    assert [phase.commands for phase in phases] == [
        (),
        (GraspCommand(GraspAction.GRASP, "arm_a", "left"),),
        (GraspCommand(GraspAction.TRANSFER, "arm_b", "right", from_arm="arm_a"),),
        (GraspCommand(GraspAction.RELEASE, "arm_b"),),
    ]
    assert phases[0].gains == {}
    assert phases[1].gains == {"nmpc": {"rolling_period": 2.0}}


@pytest.mark.parametrize(
    ("written", "read"),
    [
        ("continue", OnMiss()),
        ("abort", OnMiss(MissAction.ABORT)),
        ("{retry: 3}", OnMiss(MissAction.RETRY, 3)),
    ],
)
def test_what_a_phase_does_about_a_miss(files: Files, written: str, read: OnMiss) -> None:
    """Without a word the task goes on."""
    schedule = files.load(with_policy(f"on_miss: {written}"))
    assert [phase.on_miss for phase in schedule.phases] == [OnMiss(), read, OnMiss(), OnMiss()]


@pytest.mark.parametrize(
    ("policy", "words"),
    [
        ("on_miss: abbort", ["unknown value 'abbort'", "did you mean 'abort'"]),
        ("on_miss: retry", ["needs the number of retries: write {retry: 2}"]),
        ("on_miss: {retry: 0}", ["phases.carry.on_miss.retry is 0, must be >= 1 and <= 100"]),
        ("on_miss: {retry: 2.5}", ["retry is 2.5, must be a whole number"]),
        ("on_miss: {retry: true}", ["retry is True, must be a whole number"]),
        ("on_miss: {retry: 101}", ["retry is 101, must be >= 1 and <= 100"]),
        ("on_miss: {retries: 2}", ["unknown key 'retries'", "did you mean 'retry'"]),
        ("on_miss: {}", ["phases.carry.on_miss.retry is missing"]),
        ("on_miss: 3", ["phases.carry.on_miss is 3, must be a mapping"]),
        ("on_miss: [abort]", ["on_miss is ['abort'], must be a mapping"]),
    ],
)
def test_a_policy_that_makes_no_sense_is_refused(files: Files, policy: str, words: list[str]) -> None:
    refusal = files.refusal(with_policy(policy))
    assert f":{line_of('on_miss', with_policy(policy))}: " in refusal
    for word in words:
        assert word in refusal


def test_a_policy_needs_a_grasp_and_a_retry_a_phase_before(files: Files) -> None:
    text = SCHEDULE.replace("  - name: approach\n", "  - name: approach\n    on_miss: abort\n")
    assert "no event of the phase is a grasp or transfer" in files.refusal(text)
    text = SCHEDULE.replace("  - name: let go\n", "  - name: let go\n    on_miss: abort\n")
    assert "no event of the phase is a grasp or transfer" in files.refusal(text)
    grasp = "    on_miss: {retry: 1}\n    events:\n      - grasp: {arm: arm_a, grasp_frame: left}\n"
    text = SCHEDULE.replace("  - name: approach\n", f"  - name: approach\n{grasp}")
    assert "a retry repeats the phase before, but this is the first one" in files.refusal(text)


def test_phase_in_force(files: Files) -> None:
    """A phase holds from its start until just before the next; the last one holds on after the end."""
    schedule = files.load()
    tenths = [round(0.1 * k * _NS) for k in (0, 3, 4, 9, 10, 11, 12, 13, 14, 99)]
    assert [schedule.phase_index(t) for t in tenths] == [0, 0, 1, 1, 2, 2, 3, 3, 3, 3]
    assert schedule.phase_index(400_000_000 - 1) == 0
    assert schedule.end_ns == 1_400_000_000


def test_a_schedule_cannot_be_changed(files: Files) -> None:
    """What was checked stays as it was checked."""
    schedule = files.load()
    with pytest.raises(ValueError, match="read-only"):
        schedule.initial_joints["arm_a"][0] = 1.0
    with pytest.raises(TypeError):
        schedule.phases[0].targets["arm_a"] = Hold()  # type: ignore[index]


def test_the_shipped_schedule_is_a_handover(scenario: Scenario) -> None:
    """60 s; B holds during the first third; A grasps, then hands over to B; T_r is 2 s once it is held."""
    schedule = scenario.truth.schedule
    assert schedule.text == config_file("schedules/colliding.yaml").read_text(encoding="utf-8")
    assert schedule.end_ns == 60 * _NS
    holding = [phase for phase in schedule.phases if phase.start_ns < 20 * _NS]
    assert all(isinstance(phase.targets["arm_b"], Hold) for phase in holding)
    events = [(phase.start_ns // _NS, c.action, c.arm) for phase in schedule.phases for c in phase.commands]
    assert events == [(20, GraspAction.GRASP, "arm_a"), (40, GraspAction.TRANSFER, "arm_b")]
    for phase in schedule.phases:
        rolling_period = phase.gains.get("nmpc", {}).get("rolling_period")
        assert rolling_period == (None if phase.start_ns < 20 * _NS else 2.0)


# --- what is refused -----------------------------------------------------------------------------

# For each case: what is replaced in the good schedule, by what, the words expected, and the text on
# whose line the error is, the last one that has it.
_CARRY = "  - name: carry\n"
REFUSED: dict[str, tuple[str, str, str, str]] = {
    "unknown key at the top": (
        "phases:\n",
        "phase:\n",
        "unknown key 'phase' (did you mean 'phases'?)",
        "phase:",
    ),
    "unknown key in initial": (
        "  joints:\n",
        "  joint:\n",
        "unknown key 'joint' (did you mean 'joints'?)",
        "joint:",
    ),
    "unknown key in deputy": ("  size:", "  sise:", "unknown key 'sise' (did you mean 'size'?)", "sise"),
    "unknown key in a phase": ("duration: 0.6", "duratoin: 0.6", "(did you mean 'duration'?)", "duratoin"),
    "unknown key in a target": (
        "tool_in_world:",
        "tool_in_wold:",
        "(did you mean 'tool_in_world'?)",
        "tool_in_wold",
    ),
    "unknown key in a pose": (
        "{xyz: [1.25, 0.0, 0.75], rpy",
        "{xzy: [1.25, 0.0, 0.75], rpy",
        "'xzy'",
        "in_world: {xzy",
    ),
    "unknown arm at the start": ("    arm_a: [0.7", "    arm_c: [0.7", "unknown key 'arm_c'", "arm_c: [0.7"),
    "unknown arm in a phase": ("arm_b: hold\n\n", "arm_c: hold\n\n", "unknown key 'arm_c'", "arm_c: hold"),
    "unknown arm in an event": ("{arm: arm_b}", "{arm: arm_d}", "unknown arm 'arm_d'", "{arm: arm_d}"),
    "unknown event": ("- grasp:", "- grab:", "unknown key 'grab' (did you mean 'grasp'?)", "grab"),
    "unknown key in an event": (
        "to: arm_b,",
        "too: arm_b,",
        "unknown key 'too' (did you mean 'to'?)",
        "too:",
    ),
    "unknown grasp frame": ("{grasp_frame: left}", "{grasp_frame: lft}", "(did you mean 'left'?)", "lft"),
    "two events in one": (
        "- release: {arm: arm_b}",
        "- {release: {arm: arm_b}, grasp: {arm: arm_b, grasp_frame: left}}",
        "an event must have exactly one of grasp, release, transfer",
        "- {release",
    ),
    "missing joints of an arm": (
        "    arm_b: [-0.7, -1.7, -1.4, 1.9, -1.6, -1.4, -1.2]\n",
        "",
        "initial.joints.arm_b is missing",
        "    arm_a: [0.7",
    ),
    "missing target of an arm": (
        "      arm_b: hold\n\n",
        "\n",
        "phases.approach.arms.arm_b is missing",
        "arm_a: {grasp_frame: left}",
    ),
    "missing rpy": (
        "{xyz: [1.15, 0.02, 0.75], rpy: [3.14, -1.5, 0.0]}",
        "{xyz: [1.15, 0.02, 0.75]}",
        "phases.carry.arms.arm_a.tool_in_world.rpy is missing",
        "[1.15, 0.02",
    ),
    "missing name": (_CARRY, "  - start: 0.4\n", "phases[1].name is missing", "- start: 0.4"),
    "missing duration": ("    duration: 0.6\n", "", "phases.carry.duration is missing", "name: carry"),
    "empty name": (_CARRY, '  - name: ""\n', "phases[1].name is '', must be text", '- name: ""'),
    "number for a name": (_CARRY, "  - name: 5\n", "phases[1].name is 5, must be text", "- name: 5"),
    "target that is a word": (
        "arm_b: hold\n\n",
        "arm_b: wait\n\n",
        "phases.approach.arms.arm_b is 'wait', must be hold or a mapping",
        "wait",
    ),
    "target of two kinds": (
        "arm_a: {grasp_frame: left}",
        "arm_a: {grasp_frame: left, joints: [0, 0, 0, 0, 0, 0, 0]}",
        "must have exactly one of joints, tool_in_world, grasp_frame",
        "joints: [0, 0",
    ),
    "target of no kind": (
        "arm_a: {grasp_frame: left}",
        "arm_a: {}",
        "must have exactly one of joints",
        "arm_a: {}",
    ),
    "offset without a grasp frame": (
        "arm_a: {grasp_frame: left}",
        "arm_a: {tool_in_grasp_frame: {xyz: [0, 0, 0], rpy: [0, 0, 0]}}",
        "must have exactly one of joints",
        "arm_a: {tool_in_grasp_frame",
    ),
    "text for a time": (
        "duration: 0.6",
        "duration: long",
        "phases.carry.duration is 'long', must be a number in s",
        "long",
    ),
    "no number": (
        "duration: 0.6",
        "duration: .nan",
        "duration is nan s, must be finite",
        ".nan",
    ),
    "infinite time": (
        "duration: 0.6",
        "duration: .inf",
        "duration is inf s, must be finite",
        ".inf",
    ),
    "time beyond every float": (
        "duration: 0.6",
        "duration: 1" + 400 * "0",
        "duration is inf s, must be finite",
        "duration: 10",
    ),
    "no time at all": (
        "duration: 0.6",
        "duration: 0",
        "duration is 0 s, must be >= 1e-09 s",
        "duration: 0\n",
    ),
    "negative time": (
        "duration: 0.6",
        "duration: -0.6",
        "duration is -0.6 s, must be >= 1e-09 s",
        "-0.6\n",
    ),
    "yes for a time": ("duration: 0.6", "duration: yes", "duration is True, must be a number in s", "yes"),
    "motion longer than the phase": (
        "motion: 0.3",
        "motion: 0.5",
        "phases.approach.motion is 0.5 s, must be <= 0.4 s, the phase's duration; set motion too, or",
        "motion: 0.5",
    ),
    "no motion": (
        "motion: 0.3",
        "motion: 0.0",
        "phases.approach.motion is 0.0 s, must be >= 1e-09",
        "motion: 0.0",
    ),
    "too few joints": (
        "[0.6, -1.6, 1.3, 1.8, 1.5, -1.3, 1.1]",
        "[0.6]",
        "phases.withdraw.arms.arm_a.joints is [0.6], must be 7 numbers in rad",
        "[0.6]",
    ),
    "too many coordinates": (
        "[1.25, 0.0, 0.75]",
        "[1.25, 0.0, 0.75, 0]",
        "deputy.in_world.xyz is [1.25, 0.0, 0.75, 0], must be 3 numbers in m",
        "0.75, 0]",
    ),
    "text among coordinates": (
        "[1.25, 0.0, 0.75]",
        "[1.25, x, 0.75]",
        "deputy.in_world.xyz[1] is 'x', must be a number in m",
        "x, 0.75",
    ),
    "scalar for coordinates": (
        "[1.25, 0.0, 0.75]",
        "1.25",
        "deputy.in_world.xyz is 1.25, must be 3 numbers in m",
        "xyz: 1.25",
    ),
    "infinite coordinate": (
        "[1.25, 0.0, 0.75]",
        "[1.25, -.inf, 0.75]",
        "deputy.in_world.xyz[1] is -inf m, must be finite",
        "-.inf",
    ),
    "start outside a limit": (
        "1.4, 1.9, 1.6",
        "1.4, 2.6, 1.6",
        "arm_a_joint_4 is 2.6 rad, must be >= -2.57 and <= 2.57 rad",
        "2.6, 1.6",
    ),
    "target outside a limit": (
        "0.6, -1.6, 1.3",
        "0.6, 2.5, 1.3",
        "arm_a_joint_2 is 2.5 rad, must be >= -2.24 and <= 2.24 rad",
        "2.5,",
    ),
    "deputy with less mass than counts": (
        "mass: 0.0",
        "mass: 1.0e-12",
        "deputy.mass is 1e-12 kg, must be 0 (massless) or at least 1e-09 kg",
        "mass",
    ),
    "deputy with too much mass": (
        "mass: 0.0",
        "mass: 1.0e+6",
        "deputy.mass is 1000000.0 kg, must be >= 0 and <= 100000 kg",
        "mass",
    ),
    "deputy with the inertia of no body": (
        "mass: 0.0",
        "mass: 4.0\n  inertia: [1.0, 0.0, 0.0, 1.0, 0.0, 2.1]",
        "deputy: inertia has principal moments 1, 1, 2.1 kg m^2, none may exceed the sum of the other two",
        "inertia",
    ),
    "deputy with negative mass": (
        "mass: 0.0",
        "mass: -1.0",
        "deputy.mass is -1.0 kg, must be >= 0 and <= 100000 kg",
        "-1.0\n",
    ),
    "deputy without extent": (
        "size: [0.1, 0.34, 0.1]",
        "size: [0.1, 0, 0.1]",
        "deputy.size[1] is 0 m, must be > 0 m",
        "size: [0.1, 0,",
    ),
    "word for a mapping": (
        "base_in_world: {xyz: [0.1, -0.2, 0.3], rpy: [0.0, 0.0, 0.05]}",
        "base_in_world: here",
        "initial.base_in_world is 'here', must be a mapping",
        "here",
    ),
    "word for a list of events": (
        "    events:\n      - release: {arm: arm_b}\n",
        "    events: release\n",
        "phases.let go.events is 'release', must be a list",
        "events: release",
    ),
    "word for an event": (
        "- release: {arm: arm_b}",
        "- release",
        "phases.let go.events[0] is 'release', must be a mapping",
        "events:",
    ),
    "word for gains": (
        "nmpc: {rolling_period: 2.0}",
        "nmpc: 2.0",
        "phases.carry.gains.nmpc is 2.0, must be a mapping",
        "nmpc: 2.0",
    ),
    "key given twice": (
        "duration: 0.6\n",
        "duration: 0.6\n    duration: 0.8\n",
        "'duration' is given twice",
        "0.8",
    ),
    "gap between phases": (
        "    start: 1.0\n",
        "    start: 1.1\n",
        "phase 'withdraw' starts at 1.1 s, but the one before it ends at 1 s",
        "start: 1.1",
    ),
    "overlap of phases": (
        "    start: 1.0\n",
        "    start: 0.9\n",
        "'withdraw' starts at 0.9 s, but",
        "start: 0.9",
    ),
    "late first phase": (
        "    start: 0.0\n",
        "    start: 0.2\n",
        "'approach' starts at 0.2 s, but",
        "start: 0.2",
    ),
    "negative start": (
        "    start: 0.0\n",
        "    start: -1\n",
        "phases.approach.start is -1 s, must be >= 0 s",
        "-1\n",
    ),
    "name given twice": (
        _CARRY,
        "  - name: approach\n",
        "'approach' has the name of an earlier phase",
        "- name: approach",
    ),
    "end between two references": (
        "duration: 0.2\n    events:\n      - release",
        "duration: 0.21\n    events:\n      - release",
        "phase 'let go' ends at 1.41 s, must be a multiple of the reference period of 0.02 s",
        "name: let go",
    ),
    "release before a grasp": (
        "- grasp: {arm: arm_a, grasp_frame: left}",
        "- release: {arm: arm_a}",
        "phase 'carry': arm_a releases the deputy, but no arm holds it",
        "name: carry",
    ),
    "release by the other arm": (
        "- release: {arm: arm_b}",
        "- release: {arm: arm_a}",
        "phase 'let go': arm_a releases the deputy, but arm_b holds it",
        "name: let go",
    ),
    "both arms holding": (
        "- transfer: {from: arm_a, to: arm_b, grasp_frame: right}",
        "- grasp: {arm: arm_b, grasp_frame: right}",
        "phase 'withdraw': arm_b grasps the deputy while arm_a holds it",
        "name: withdraw",
    ),
    "transfer from an arm that holds nothing": (
        "- grasp: {arm: arm_a, grasp_frame: left}",
        "- grasp: {arm: arm_b, grasp_frame: left}",
        "phase 'withdraw': a transfer from arm_a, but arm_b holds the deputy",
        "name: withdraw",
    ),
    "transfer before a grasp": (
        "- grasp: {arm: arm_a, grasp_frame: left}",
        "- transfer: {from: arm_a, to: arm_b, grasp_frame: left}",
        "phase 'carry': a transfer from arm_a, but no arm holds the deputy",
        "name: carry",
    ),
    "holder sent to the deputy it holds": (
        "tool_in_world: {xyz: [1.2, -0.42, 0.75], rpy: [3.14, -1.5, 0.0]}",
        "grasp_frame: right",
        "arm_b holds the deputy, so its target at grasp frame 'right' would move with the arm",
        "name: withdraw",
    ),
    "transfer to itself": (
        "to: arm_b, grasp",
        "to: arm_a, grasp",
        "a transfer from arm_a to itself",
        "name: withdraw",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_wrong_is_said_with_its_line(files: Files, case: str) -> None:
    """One change makes the schedule wrong; the error has the file, the line and the reason, in one line."""
    old, new, words, marker = REFUSED[case]
    assert SCHEDULE.count(old) >= 1
    text = SCHEDULE.replace(old, new, 1)
    message = files.refusal(text)
    assert words in message
    last = max(number for number, line in enumerate(text.splitlines(keepends=True), 1) if marker in line)
    assert message.startswith(f"{files.path}:{last}: ")


def test_missing_sections_are_named(files: Files) -> None:
    """Without initial state, deputy or phases there is no task; the line is that of the section around."""
    for name, after in (("initial", "deputy:"), ("deputy", "phases:")):
        start = SCHEDULE.index(f"{name}:\n")
        text = SCHEDULE[:start] + SCHEDULE[SCHEDULE.index(after) :]
        assert files.refusal(text) == f"{files.path}:1: {name} is missing"
    text = SCHEDULE[: SCHEDULE.index("phases:")]
    assert files.refusal(text) == f"{files.path}:1: phases is missing"
    assert "phases has 0 entries, must be >= 1" in files.refusal(text + "phases: []\n")
    assert "phases is {'a': 1}, must be a list" in files.refusal(text + "phases: {a: 1}\n")
    assert "phases[0] is 1, must be a mapping" in files.refusal(text + "phases: [1]\n")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "must be a mapping at the top level"),
        ("- 1\n", "must be a mapping at the top level"),
        ("just words\n", "must be a mapping at the top level"),
        ("initial: [1,\n", ":2: not valid YAML"),
        ("a: b: c\n", ":1: not valid YAML: mapping values are not allowed here"),
        ("\tinitial: 1\n", ":1: not valid YAML"),
        ("initial: *nowhere\n", ":1: not valid YAML: found undefined alias"),
    ],
)
def test_what_is_not_a_schedule_at_all(files: Files, text: str, words: str) -> None:
    """Neither YAML nor a mapping: said with the path, in one line."""
    message = files.refusal(text)
    assert words in message
    assert str(files.path) in message


def test_files_that_cannot_be_read(files: Files, robot: RobotModel) -> None:
    """A missing file, a folder and bytes that are no text are named."""
    with pytest.raises(ConfigurationError, match=r"cannot read .*schedule\.yaml: No such file"):
        load_schedule(files.path, robot, _PERIOD_NS)
    with pytest.raises(ConfigurationError, match=r"cannot read .*: Is a directory"):
        load_schedule(files.path.parent, robot, _PERIOD_NS)
    files.path.write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigurationError, match=r"cannot read .*schedule\.yaml: 'utf-8' codec can't decode"):
        load_schedule(files.path, robot, _PERIOD_NS)


def test_a_tag_runs_no_code(files: Files) -> None:
    """YAML can name Python functions; a schedule that does is refused, and nothing is called."""
    text = SCHEDULE.replace("duration: 0.6", 'duration: !!python/object/apply:os.system ["exit 1"]')
    assert "could not determine a constructor" in files.refusal(text)


def test_gains_of_an_unknown_law_are_refused_when_the_controller_is_made(make_scenario: MakeScenario) -> None:
    """The loader keeps gains as they are; the controller says which law or gain of which phase is unknown."""
    for old, words in (("nmpc: {", "nmcp: {"), ("rolling_period: 2.0", "rolling_perod: 2.0")):
        scenario = make_scenario(SCHEDULE.replace(old, words))
        with pytest.raises(ConfigurationError, match=r"gains of phase 'carry': unknown .* \(did you mean"):
            gains_by_phase(scenario.truth.schedule, scenario.parameters.controller)
