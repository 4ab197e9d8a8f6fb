"""Parameters are refused whole and in plain words: name, type, range, choice, file."""

from dataclasses import dataclass, is_dataclass
from math import inf, nan
from pathlib import Path

import pytest

from sms_handover.configuration.parameters import (
    EVERY_NODE,
    build,
    parameter,
    read_parameter_files,
    specs_of,
)
from sms_handover.configuration.yaml_reader import read_yaml
from sms_handover.control.nmpc import NMPC, NmpcGains
from sms_handover.control.parameters import gains_of
from sms_handover.control.pid import PID, PidGains
from sms_handover.errors import ConfigurationError, SmsHandoverError, UnknownNameError
from sms_handover.simulation.scenario import load_parameters


@dataclass(frozen=True)
class Sample:
    """One parameter of every kind."""

    length: float = parameter("a length", unit="m", minimum=0.5, maximum=2.0)
    count: int = parameter("a count", minimum=1)
    name: str = parameter("a name", choices=("red", "green"))
    active: bool = parameter("a switch")
    offsets: tuple[float, ...] = parameter("offsets", unit="rad", minimum=-1.0)
    labels: tuple[str, ...] = parameter("labels", choices=("a", "b"))


GOOD: dict[str, object] = {
    "length": 1.5,
    "count": 3,
    "name": "red",
    "active": True,
    "offsets": [0.0, 1],
    "labels": ["a"],
}


def test_good_values_are_taken_as_their_type() -> None:
    """A list becomes a tuple, a whole number a float where a float is asked for; bounds are inclusive."""
    assert build(Sample, GOOD, "here") == Sample(1.5, 3, "red", True, (0.0, 1.0), ("a",))
    built = build(Sample, {**GOOD, "length": 2, "count": 1, "offsets": [-1]}, "here")
    assert (built.length, built.count, built.offsets) == (2.0, 1, (-1.0,))
    assert isinstance(built.length, float) and isinstance(built.offsets[0], float)


REFUSED: dict[str, tuple[str, object, str]] = {
    "below": ("length", 0.4, "'length' is 0.4 m, must be >= 0.5 and <= 2 m"),
    "above": ("length", 2.1, "'length' is 2.1 m, must be >= 0.5 and <= 2 m"),
    "not a number": ("length", nan, "'length' is nan m, must be finite"),
    "infinite": ("length", inf, "'length' is inf m, must be finite"),
    "too large for a float": ("length", 10**400, "'length' is inf m, must be finite"),
    "text for a number": ("length", "1.5", "'length' is '1.5', must be a number in m"),
    "switch for a number": ("length", True, "'length' is True, must be a number in m"),
    "nothing for a number": ("length", None, "'length' is None, must be a number in m"),
    "list for a number": ("length", [1.0], "'length' is [1.0], must be a number in m"),
    "fraction for a count": ("count", 1.5, "'count' is 1.5, must be a whole number"),
    "whole float for a count": ("count", 2.0, "'count' is 2.0, must be a whole number"),
    "switch for a count": ("count", True, "'count' is True, must be a whole number"),
    "too small a count": ("count", 0, "'count' is 0, must be >= 1"),
    "unknown choice": (
        "name",
        "gren",
        "unknown value 'gren' (did you mean 'green'?): known are 'red', 'green'",
    ),
    "number for text": ("name", 1, "'name' is 1, must be text"),
    "number for a switch": ("active", 1, "'active' is 1, must be true or false"),
    "scalar for a list": ("offsets", 0.5, "'offsets' is 0.5, must be a list"),
    "text for a list": ("labels", "a", "'labels' is 'a', must be a list"),
    "bad item": ("offsets", [0.0, "x"], "'offsets' is 'x', must be a number in rad"),
    "item below": ("offsets", [0.0, -1.5], "'offsets' is -1.5 rad, must be >= -1 rad"),
    "unknown item": ("labels", ["a", "c"], "unknown value 'c': known are 'a', 'b'"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_values_are_refused(case: str) -> None:
    """The message names where, which parameter, what it is and what is allowed, on one line."""
    name, value, expected = REFUSED[case]
    with pytest.raises(ConfigurationError) as caught:
        build(Sample, {**GOOD, name: value}, "plant")
    text = str(caught.value)
    assert text.startswith(f"plant: parameter {name!r}")
    assert expected in text
    assert "\n" not in text


def test_an_unknown_name_is_answered_with_the_nearest() -> None:
    """A misspelt parameter is not ignored."""
    with pytest.raises(
        UnknownNameError, match=r"plant: unknown parameter 'lenght' \(did you mean 'length'\?\)"
    ):
        build(Sample, {**GOOD, "lenght": 1.0}, "plant")


@pytest.mark.parametrize("name", GOOD)
def test_a_missing_value_is_named(name: str) -> None:
    """There are no defaults in code: every number stands in a file."""
    with pytest.raises(ConfigurationError, match=f"plant: parameter '{name}' is missing"):
        build(Sample, {key: value for key, value in GOOD.items() if key != name}, "plant")


def test_errors_have_one_root_and_remain_value_errors() -> None:
    """A caller can catch everything of this package, or what Python calls a bad value."""
    with pytest.raises(SmsHandoverError):
        build(Sample, {}, "plant")
    with pytest.raises(ValueError, match="missing"):
        build(Sample, {}, "plant")


def test_every_parameter_says_what_it_means() -> None:
    """Each field of each group has a description, and the shipped files fill each group."""
    shipped = load_parameters()
    for group in (shipped.common, shipped.plant, shipped.trajectory, shipped.ik, shipped.controller):
        assert is_dataclass(group)
        assert all(spec.description for spec in specs_of(type(group)).values())


def _write(path: Path, text: str) -> Path:
    """Write a file and return its path."""
    path.write_text(text, encoding="utf-8")
    return path


def test_later_files_win_and_other_sections_do_not_matter(tmp_path: Path) -> None:
    """Files in ROS form are laid over each other, parameter by parameter."""
    first = _write(
        tmp_path / "1.yaml", "plant:\n  ros__parameters: {a: 1, b: 2}\nik:\n  ros__parameters: {a: 9}\n"
    )
    second = _write(
        tmp_path / "2.yaml", "plant:\n  ros__parameters: {b: 3}\n/**:\n  ros__parameters: {c: 4}\n"
    )
    assert read_parameter_files([first, second], "plant") == {"a": 1, "b": 3}
    assert read_parameter_files([second, first], "plant") == {"a": 1, "b": 2}
    assert read_parameter_files([first, second], EVERY_NODE) == {"c": 4}
    assert read_parameter_files([first, second], "recorder") == {}


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("plant: 5\n", "plant is 5, must be a mapping"),
        ("plant: {a: 1}\n", "plant.ros__parameters is missing"),
        ("plant: {ros__parameters: [1]}\n", r"plant.ros__parameters is \[1\], must be a mapping"),
    ],
)
def test_a_section_without_parameters_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    """A file that is not in ROS form is said to be so instead of being ignored."""
    path = _write(tmp_path / "p.yaml", text)
    with pytest.raises(ConfigurationError, match=rf"p\.yaml:1: {reason}"):
        read_parameter_files([path], "plant")


def test_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    """Missing, a folder, not YAML, not text, not a mapping: one line each, with the path."""
    folder = tmp_path / "folder"
    folder.mkdir()
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(b"\xff\xfe\x00a")
    cases = {
        tmp_path / "none.yaml": "No such file or directory",
        folder: "Is a directory",
        _write(
            tmp_path / "broken.yaml", "a: [1,\nb: 2\n"
        ): r":3: not valid YAML: while parsing a flow sequence \(line 1\): expected",
        _write(tmp_path / "tag.yaml", "a: !!python/object/apply:os.getcwd []\n"): ":1: not valid YAML",
        binary: "can't decode byte 0xff",
        _write(tmp_path / "list.yaml", "- 1\n"): "must be a mapping at the top level",
        _write(tmp_path / "empty.yaml", ""): "must be a mapping at the top level",
    }
    for path, reason in cases.items():
        with pytest.raises(ConfigurationError, match=reason) as caught:
            read_yaml(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)


# --- groups with rules of their own --------------------------------------------------------------


def test_reference_period_is_a_whole_number_of_ticks() -> None:
    """A period between two ticks would fall where there is no state."""
    with pytest.raises(
        ConfigurationError, match=r"reference_period is 0\.02 s.*multiple of the tick of 0\.003 s"
    ):
        load_parameters({"common": {"tick": 0.003, "reference_period": 0.02}})
    common = load_parameters({"common": {"tick": 0.005, "reference_period": 0.02}}).common
    assert (common.tick_ns, common.reference_ns, common.ticks_per_reference) == (5_000_000, 20_000_000, 4)


def test_overrides_of_unknown_nodes_are_refused() -> None:
    """An override for a node that does not exist would change nothing."""
    with pytest.raises(UnknownNameError, match=r"unknown node 'plnt' \(did you mean 'plant'\?\)"):
        load_parameters({"plnt": {"integrator": "rk4"}})
    with pytest.raises(UnknownNameError, match=r"plant: unknown parameter 'tick'"):
        load_parameters({"plant": {"tick": 0.001}})


def test_overrides_lie_over_files(tmp_path: Path) -> None:
    """Shipped file, then the user's file, then the option."""
    path = _write(tmp_path / "mine.yaml", "controller:\n  ros__parameters: {control_order: 2, law: pid}\n")
    parameters = load_parameters({"controller": {"law": "nmpc"}}, [path])
    assert (parameters.controller.control_order, parameters.controller.law) == (2, "nmpc")


def test_gains_of_a_phase_lie_over_those_of_the_controller() -> None:
    """A phase changes what it names and nothing else, and only gains of the law in use."""
    gains: dict[str, object] = {"control_order": 1, "proportional": 2.0, "integral": 3.0, "derivative": 4.0}
    nmpc = load_parameters({"controller": {"law": "nmpc", **gains}}).controller
    assert gains_of(NMPC, nmpc, {}, "here") == NmpcGains(1.0, 1)
    assert gains_of(NMPC, nmpc, {"rolling_period": 2}, "here") == NmpcGains(2.0, 1)
    pid = load_parameters({"controller": {"law": "pid", **gains}}).controller
    assert gains_of(PID, pid, {"integral": 0.5}, "here") == PidGains(2.0, 0.5, 4.0)
    with pytest.raises(UnknownNameError, match=r"here: unknown gain of pid 'rolling_period'"):
        gains_of(PID, pid, {"rolling_period": 2.0}, "here")
    with pytest.raises(
        UnknownNameError, match=r"unknown gain of nmpc 'roling_period' \(did you mean 'rolling"
    ):
        gains_of(NMPC, nmpc, {"roling_period": 2.0}, "here")
    with pytest.raises(
        ConfigurationError, match=r"here: parameter 'rolling_period' is 0 s, must be >= 0.001 s"
    ):
        gains_of(NMPC, nmpc, {"rolling_period": 0}, "here")
    with pytest.raises(ConfigurationError, match=r"'control_order' is 4, must be >= 0 and <= 3"):
        gains_of(NMPC, nmpc, {"control_order": 4}, "here")
