"""Bad messages and bad files: strangers that talk into a run, and YAML that is not what it should be."""

import subprocess
import sys
from collections.abc import Callable
from contextlib import nullcontext
from functools import partial
from pathlib import Path

from sms_handover.bag.info import read_info
from sms_handover.configuration.package_files import config_file
from sms_handover.errors import Reason
from sms_handover.graph.topics import (
    BASE_ODOMETRY,
    DEPUTY_POSE,
    GRASP_EVENT,
    IK,
    JOINT_COMMAND,
    JOINT_REFERENCE,
    JOINT_STATES,
    REFUSED_TOPIC,
    RUN_EVENTS,
    RUN_PUBLISHED,
    RUN_RECORDED,
    RUN_STATE,
    SAMPLED_BASE_ODOMETRY,
    SAMPLED_JOINT_STATES,
    TASK_PHASE,
)

from ..system.runs import Ended
from .fault import Fault
from .graph_run import domain_of, held, under_way
from .outcome import Kept, require
from .promises import refused, whole
from .trial import Trial

TITLE = "Bad messages and bad files"

_INTRUDER = Path(__file__).resolve().parent / "intruder.py"
_DURATION_S = 3.0  # s of simulated time
_REAL_TIME_S = 6.0  # s of simulated time

# Strangers


def intrude(words: tuple[str, ...], trial: Trial, *, real_time: bool = False) -> Ended:
    """Let a stranger, a Python command, talk into a run from a random moment to its end.

    It is there from the start on, and a run in lock step is held until it has been heard.
    """
    options = ["--real-time", "--duration", _REAL_TIME_S] if real_time else ["--duration", _DURATION_S]
    with trial.start("run", "-o", "run", *options) as run:
        domain = domain_of(run)
        environment = trial.environment(
            {
                "ROS_DOMAIN_ID": str(domain),
                "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
                "PYTHONPATH": str(_INTRUDER.parents[2]),
            }
        )
        with (trial.folder / "stranger.txt").open("w", encoding="utf-8") as said:
            command = [sys.executable, *words]
            stranger = subprocess.Popen(
                command, env=environment, stdin=subprocess.PIPE, stdout=said, stderr=said, text=True
            )
            try:
                run.until_recorded(trial.folder / "run" / "bag", under_way(trial))
                with nullcontext() if real_time else held(run, IK):
                    _tell(stranger, "talk\n")
                    run.until(lambda: "talked" in _said(trial), "the stranger has been heard")
                return trial.ended(run)
            finally:
                stranger.kill()
                stranger.wait()


def _tell(process: "subprocess.Popen[str]", line: str) -> None:
    """Give a process a line to read."""
    assert process.stdin
    process.stdin.write(line)
    process.stdin.flush()


def _said(trial: Trial) -> str:
    """Return what the stranger has said of itself."""
    return (trial.folder / "stranger.txt").read_text(encoding="utf-8")


def nothing_changed(topic: str, trial: Trial, ended: Ended) -> Kept:
    """Require a whole run, what was refused named, and states that the commands in the bag lead to."""
    kept = refused_and_whole(topic, trial, ended)
    again = trial.sms_handover("verify", trial.folder / "run" / "bag")
    require(again.code == 0, f"the commands do not lead to the states: {again.out[-300:]} {again.err}")
    return kept


def refused_and_whole(topic: str, trial: Trial, ended: Ended) -> Kept:
    """Require a whole run and a bag in which the stranger's messages stand by themselves."""
    bag = trial.folder / "run" / "bag"
    kept = whole(bag, ended)
    topics = read_info(bag).topics
    apart = topics.get(f"/{topic}{REFUSED_TOPIC}")
    require(apart is not None and apart.message_count, "nothing of the stranger is in the bag")
    log = "".join(path.read_text(encoding="utf-8") for path in (trial.folder / "run" / "log").glob("*.log"))
    require(Reason.SENDER.value in log, "no node says that it has refused something")
    return kept


def parameter_kept(trial: Trial, ended: Ended) -> Kept:
    """Require a whole run, and that the change was refused with a reason."""
    said = _said(trial)
    require("False" in said and "True" not in said, f"the parameter was changed: {said[:200]}")
    return whole(trial.folder / "run" / "bag", ended)


def _stranger(topic: str, kind: str, words: str) -> Fault[Ended]:
    """Return a stranger that publishes on a topic in lock step."""
    return Fault(
        name=f"{kind}-on-{topic.replace('/', '-').replace('_', '-')}",
        injected=f"a second node publishes on {topic}: {words}",
        promise="refused, named, recorded apart; the run ends with 0 and is what its commands make of it",
        inject=partial(intrude, (str(_INTRUDER), topic, kind)),
        check=partial(nothing_changed, topic),
        seeded=True,
    )


def _in_real_time(topic: str, kind: str, words: str) -> Fault[Ended]:
    """Return a stranger that publishes on a topic in real time."""
    return Fault(
        name=f"real-time-{kind}-on-{topic.replace('/', '-').replace('_', '-')}",
        injected=f"a second node publishes on {topic} in real time: {words}",
        promise="refused, named, recorded apart; the run ends with 0",
        inject=partial(intrude, (str(_INTRUDER), topic, kind), real_time=True),
        check=partial(refused_and_whole, topic),
        seeded=True,
    )


# Files


def with_file(name: str, text: Callable[[], str], option: tuple[str, ...], trial: Trial) -> Ended:
    """Give a run a file that is wrong."""
    path = trial.folder / name
    path.write_text(text(), encoding="utf-8")
    return trial.sms_handover("run", "-o", "run", *option[:-1], f"{option[-1]}{path}")


def is_refused(words: tuple[str, ...], trial: Trial, ended: Ended) -> Kept:
    """Require exit code 2 and one line that names the place, before anything was made."""
    kept = refused(ended, *words)
    require(not (trial.folder / "run").exists(), "an output folder was made")
    return kept


def _schedule(before: str, after: str) -> Callable[[], str]:
    def text() -> str:
        shipped = config_file("schedules/colliding.yaml").read_text(encoding="utf-8")
        assert before in shipped
        return shipped.replace(before, after, 1)

    return text


def _bomb() -> str:
    """Return a text of a few lines that is a thousand million words with its aliases written out."""
    levels = (f"k{n}: &k{n} [{', '.join([f'*k{n - 1}'] * 10)}]\n" for n in range(1, 10))
    return "k0: &k0 lol\n" + "".join(levels)


def _file(
    name: str, injected: str, text: Callable[[], str], option: tuple[str, ...], *words: str
) -> Fault[Ended]:
    return Fault(
        name=name,
        injected=injected,
        promise="exit code 2 and one line that names the place; nothing is started or made",
        inject=partial(with_file, f"{name}.yaml", text, option),
        check=partial(is_refused, words),
    )


_SCHEDULE = ("--schedule", "")
_PARAMETERS = ("--params-file", "")

FAULTS = (
    _stranger(JOINT_COMMAND, "good", "good commands of another controller"),
    _stranger(JOINT_COMMAND, "nan", "NaN"),
    _stranger(JOINT_COMMAND, "other-names", "joints of another robot"),
    _stranger(JOINT_COMMAND, "truncated", "half a message"),
    _stranger(JOINT_COMMAND, "oversized", "100 kB behind the end"),
    _stranger(JOINT_COMMAND, "future", "a stamp from the future"),
    _stranger(JOINT_STATES, "good", "states of time zero, which begin a run anew"),
    _stranger(JOINT_STATES, "infinite", "infinity"),
    _stranger(BASE_ODOMETRY, "not-unit", "a quaternion of length 2"),
    _stranger(BASE_ODOMETRY, "other-frame", "another frame"),
    _stranger(SAMPLED_JOINT_STATES, "future", "a stamp from the future"),
    _stranger(SAMPLED_BASE_ODOMETRY, "nan", "NaN"),
    _stranger(JOINT_REFERENCE, "nan", "NaN"),
    _stranger(TASK_PHASE, "good", "a phase of its own"),
    _stranger(DEPUTY_POSE, "truncated", "half a message"),
    _stranger(GRASP_EVENT, "good", "a grasp that never was"),
    _stranger(GRASP_EVENT, "missed", "a grasp that has missed"),
    _stranger(RUN_STATE, "over", "that the run is over"),
    _stranger(RUN_PUBLISHED, "lie", "that the plant has published a thousand million states"),
    _stranger(RUN_PUBLISHED, "truncated", "half a message"),
    _stranger(RUN_EVENTS, "good", "a decision of its own"),
    _stranger(RUN_RECORDED, "future", "that all of the run is recorded"),
    _in_real_time(JOINT_COMMAND, "good", "good commands of another controller"),
    _in_real_time(JOINT_COMMAND, "nan", "NaN"),
    _in_real_time(JOINT_STATES, "good", "states of time zero, which begin a run anew"),
    *(
        Fault(
            name=f"{parameter.replace('_', '-')}-changed-while-running",
            injected=f"parameter {parameter} of the plant is set while a run goes on",
            promise="refused with a reason; the run ends with 0 and a whole bag",
            inject=partial(intrude, (str(_INTRUDER), "parameters", parameter)),
            check=parameter_kept,
            seeded=True,
        )
        for parameter in ("tick", "use_sim_time")
    ),
    _file(
        "schedule-key-twice",
        "a key of the schedule given twice",
        _schedule("phases:", "phases: []\nphases:"),
        _SCHEDULE,
        "'phases' is given twice",
    ),
    _file(
        "schedule-key-misspelt",
        "a key of the schedule misspelt",
        _schedule("duration:", "durration:"),
        _SCHEDULE,
        "did you mean 'duration'?",
    ),
    _file(
        "schedule-bomb",
        "a schedule of aliases of aliases",
        _bomb,
        _SCHEDULE,
        "its aliases expanded",
    ),
    _file("schedule-huge", "a schedule of 10 MB", lambda: "#" * 10**7, _SCHEDULE, "more than"),
    _file(
        "schedule-code",
        "a schedule with a Python object",
        lambda: "phases: !!python/object/apply:os.system [touch run]\n",
        _SCHEDULE,
        "schedule-code.yaml:1",
    ),
    _file(
        "parameter-misspelt",
        "a parameter misspelt",
        lambda: "controller:\n  ros__parameters:\n    lwa: pid\n",
        _PARAMETERS,
        "yaml:3",
        "did you mean 'law'?",
    ),
    _file(
        "parameter-of-no-node",
        "a node misspelt in a parameter file",
        lambda: "contoller:\n  ros__parameters: {law: pid}\n",
        _PARAMETERS,
        "did you mean 'controller'?",
    ),
    _file(
        "parameter-of-wrong-type",
        "a parameter of the wrong type",
        lambda: "plant:\n  ros__parameters:\n    resend_after: soon\n",
        _PARAMETERS,
        "yaml:3",
        "a number",
    ),
)
