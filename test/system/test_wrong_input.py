"""Wrong input ends in one line and exit code 2 before any node is started."""

from argparse import ArgumentParser
from importlib import import_module
from pathlib import Path

import pytest
import yaml

from sms_handover.configuration.package_files import config_file

from .conftest import Command
from .runs import sms_handover

pytestmark = pytest.mark.system


def parameters(node: str, **values: object) -> str:
    """Return the text of a parameter file in ROS form."""
    return yaml.safe_dump({node: {"ros__parameters": values}})


def files() -> dict[str, str]:
    """Return the texts of the files that the cases use, by name."""
    shipped = config_file("schedules/colliding.yaml").read_text(encoding="utf-8")
    target = yaml.safe_load(shipped)["phases"][1]["arms"]["arm_a"]["tool_in_world"]["xyz"]
    far = [target[0] + 1.0, *target[1:]]
    return {
        "frame.yaml": shipped.replace("{grasp_frame: end_a}", "{grasp_frame: end_x}", 1),
        "reach.yaml": shipped.replace(str(target), str(far), 1),
        "broken.yaml": "phases: [",
        "list.yaml": "- 1\n",
        "unknown.yaml": parameters("controller", no_such=1.0),
        "type.yaml": parameters("/**", tick="often"),
        "recorder.yaml": parameters("recorder", drain_timeout=-1.0),
        "text": "",
        "taken/mine": "keep",
    }


WRONG = {
    "controller": (["--controller", "pdi"], "unknown control law 'pdi' (did you mean 'pid'?)"),
    "own controller beside ours": (["--controller", "pid", "--own-controller", "true"], "give one"),
    "own controller that is not there": (["--own-controller", "no_such x"], "no program 'no_such'"),
    "own controller that is empty": (["--own-controller", " "], "is empty"),
    "own controller half quoted": (["--own-controller", "'true"], "No closing quotation"),
    "two own controllers": (["--own-controller", "true", "--without-controller"], "not allowed with"),
    "time law": (["--time-law", "cubic"], "invalid choice: 'cubic'"),
    "option": (["--no-such-option"], "unrecognized arguments"),
    "missing schedule": (["--schedule", "nowhere.yaml"], "cannot read "),
    "folder for a schedule": (["--schedule", "taken"], "cannot read "),
    "schedule that is no YAML": (["--schedule", "broken.yaml"], "broken.yaml"),
    "schedule that is no mapping": (["--schedule", "list.yaml"], "list.yaml"),
    "unknown grasp frame": (["--schedule", "frame.yaml"], "unknown grasp frame 'end_x'"),
    "target out of reach": (["--schedule", "reach.yaml"], "is out of reach"),
    "missing robot": (["--robot", "nowhere.yaml"], "nowhere.yaml"),
    "robot": (["--robot", "reach.yaml"], "unknown key 'initial'"),
    "parameter name": (["-p", "plant.integrater:=rk4"], "did you mean 'integrator'?"),
    "parameter value": (["-p", "controller.rolling_period:=-1.0"], "-1.0 s, must be >= 0.001 s"),
    "parameter type": (["-p", "controller.rolling_period:=long"], "'long', must be a number in s"),
    "parameter form": (["-p", "tick=1"], "NODE.NAME:=VALUE"),
    "parameter without a value": (["-p", "common.tick:="], "'tick' is None"),
    "node": (["-p", "plnt.integrator:=rk4"], "did you mean 'plant'?"),
    "recorder parameter": (["-p", "recorder.drain_timeout:=-1.0"], "-1.0 s, must be >= 0.1"),
    "recorder parameter name": (["-p", "recorder.drain:=1.0"], "unknown parameter 'drain'"),
    "missing parameter file": (["--params-file", "nowhere.yaml"], "cannot read"),
    "parameter name in a file": (["--params-file", "unknown.yaml"], "unknown parameter 'no_such'"),
    "parameter type in a file": (["--params-file", "type.yaml"], "'often', must be a number in s"),
    "recorder parameter in a file": (["--params-file", "recorder.yaml"], "-1.0 s, must be >= 0.1"),
    "unstable loop": (["-p", "common.tick:=0.002", "--controller", "pid"], "joint_7"),
    "reference period": (["-p", "common.tick:=0.003"], "a multiple of the tick"),
    "duration": (["--duration", "-3"], "-3.0 s, must be >= 0 s"),
    "endless duration": (["--duration", "inf"], "is inf s, must be finite"),
    "domain": (["--domain-id", "400"], "must be 0 to 101"),
    "negative domain": (["--domain-id", "-1"], "must be 0 to 101"),
    "domain that is no number": (["--domain-id", "one"], "invalid int value"),
    "node of a host": (
        ["--nodes", "plant,recoder", "--domain-id", "5"],
        "'recoder' cannot be started, must be of plant",
    ),
    "recorder of no recording": (
        ["--nodes", "recorder", "--no-record"],
        "cannot be started without a recorder, must be of plant",
    ),
    "hosts without a domain": (["--peers", "127.0.0.1"], "give each host the same --domain-id"),
    "nodes without a domain": (["--nodes", "plant"], "give each host the same --domain-id"),
    "host that is not known": (
        ["--peers", "no.such.invalid", "--domain-id", "5"],
        "'no.such.invalid' has no IPv4",
    ),
    "output that cannot be": (["-o", "text/run"], "cannot be made"),
    "output that is a file": (["-o", "text"], "exists"),
    "output that exists": (["-o", "taken"], "exists"),
    "output that no run has made": (["-o", "taken", "--overwrite"], "exists"),
    "domain and an earlier run": (["-o", "earlier", "--overwrite", "--domain-id", "400"], "0 to 101"),
}


def tree(folder: Path) -> dict[str, str]:
    """Return every file and folder, with the text of the files."""
    return {
        str(path.relative_to(folder)): path.read_text(encoding="utf-8") if path.is_file() else ""
        for path in folder.rglob("*")
    }


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the files that the cases use, and what looks like an earlier run."""
    for name, text in files().items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "earlier" / "log").mkdir(parents=True)
    (tmp_path / "earlier" / "log" / "plant.log").write_text("an earlier run", encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize("case", WRONG)
def test_nothing_is_started(case: str, folder: Path, called: Command) -> None:
    """One line names the value and what is allowed; nothing is made or changed, so no node has run."""
    before = tree(folder)
    arguments, told = WRONG[case]
    done = called("run", *arguments, cwd=folder)
    assert done.code == 2, done
    assert len(done.errors) == 1 and told in done.errors[0], done
    assert "Traceback" not in done.err
    assert done.err.splitlines()[-1] == done.errors[0]
    assert done.out == ""
    assert tree(folder) == before


def test_the_command_of_a_shell_says_and_returns_the_same(folder: Path, called: Command) -> None:
    arguments, _ = WRONG["target out of reach"]
    assert sms_handover("run", *arguments, cwd=folder) == called("run", *arguments, cwd=folder)


def test_simulate_refuses_the_same(folder: Path, called: Command) -> None:
    for case in ("target out of reach", "parameter value", "unstable loop"):
        arguments, told = WRONG[case]
        done = called("simulate", *arguments, cwd=folder)
        assert done.code == 2, done
        assert len(done.errors) == 1 and told in done.errors[0], done


def test_run_simulate_and_check_describe_a_scenario_alike() -> None:
    """Each takes what the others take, and has options of its own for what it does with it."""
    taken = {}
    for verb in ("run", "simulate", "check"):
        parser = ArgumentParser()
        import_module(f"sms_handover.cli.{verb}").add_parser(parser)
        (group,) = [group for group in parser._action_groups if group.title == "scenario"]
        taken[verb] = [(action.dest, *action.option_strings) for action in group._group_actions]
    assert taken["run"] == taken["simulate"] == taken["check"]


def test_numbers_are_read_as_ros_reads_them(schedule: Path, tmp_path: Path, called: Command) -> None:
    """An exponent without a decimal point makes a number too."""
    arguments = ("-p", "common.tick:=1e-3", "--duration", "0.02", "--schedule", schedule)
    done = called("simulate", *arguments, cwd=tmp_path)
    assert done.code == 0, done


@pytest.mark.parametrize("command", [[], ["run"], ["simulate"], ["compare"], ["verify"]])
def test_help_teaches(command: list[str], tmp_path: Path, called: Command) -> None:
    """Every command tells what it does and exits with 0."""
    done = called(*command, "--help", cwd=tmp_path)
    assert done.code == 0
    assert "usage: sms-handover" in done.out
    assert done.err == ""


@pytest.mark.parametrize("arguments", [[], ["fly"], ["compare"], ["verify"]])
def test_a_command_must_be_whole(arguments: list[str], tmp_path: Path, called: Command) -> None:
    done = called(*arguments, cwd=tmp_path)
    assert (done.code, len(done.errors)) == (2, 1)


def test_collisions_are_told_before_a_run_and_may_be_rejected(
    schedule: Path, tmp_path: Path, called: Command
) -> None:
    """The gripper that has let go of the deputy comes back into it; nothing is started or made."""
    worst = "at worst arm_a_gripper and deputy overlap by 1.72 mm at 1.02 s"
    done = called(
        "run", "--reject-collisions", "--time-law", "step", "--schedule", schedule, "-o", "out", cwd=tmp_path
    )
    assert done.code == 2 and f"error: bodies collide from 0.86 s on, {worst}" in done.err
    assert tree(tmp_path) == {}
    done = called("check", "--reject-collisions", "--time-law", "step", "--schedule", schedule, cwd=tmp_path)
    assert done.code == 2 and worst in done.err and "can be run" not in done.out
    for options, code in (((), 0), (("--reject-collisions",), 1)):
        done = called("simulate", *options, "--time-law", "step", "--schedule", schedule, cwd=tmp_path)
        assert done.code == code and f"warning: bodies collide, {worst}" in done.err
