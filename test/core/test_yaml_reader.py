"""YAML that is not data for us is refused in one line that names the place, quickly and in little memory."""

import os
from math import inf
from pathlib import Path

import pytest
import yaml

from sms_handover.cli.main import main
from sms_handover.configuration.yaml_reader import LARGEST_FILE, load, read_yaml
from sms_handover.errors import ConfigurationError, UnknownNameError
from sms_handover.simulation.scenario import load_parameters, load_scenario

BOMB = "a: &a [lol, lol, lol, lol, lol, lol, lol, lol, lol]\n" + "".join(
    f"{chr(97 + n)}: &{chr(97 + n)} [{', '.join([f'*{chr(96 + n)}'] * 9)}]\n" for n in range(1, 9)
)

REFUSED = {
    "a key twice": ("a: 1\nb: 2\na: 3\n", ":3: not valid YAML: .*key 'a' is given twice"),
    "a key twice inside": ("a:\n  b: 1\n  b: 2\n", ":3: not valid YAML: .*key 'b' is given twice"),
    "a bomb of aliases": (BOMB, ":6: not valid YAML: .*too large with its aliases expanded"),
    "itself": ("a: &a [1, *a]\n", ":1: not valid YAML: .*refers to what it is in"),
    "levels": ("a: " + "[" * 40 + "]" * 40, ":1: not valid YAML: .*more than 32 nested levels"),
    "very many levels": ("a: " + "[" * 100_000, ":1: not valid YAML: .*more than 32 nested levels"),
    "an object": (
        "a: !!python/object/apply:os.system [ls]\n",
        ":1: not valid YAML: .*could not determine a constructor",
    ),
    "a date that is none": (
        "a: 2001-13-45\n",
        ":1: not valid YAML: .*is not a valid timestamp: month must be in 1..12",
    ),
    "a number that is none": ("a: !!int x\n", ":1: not valid YAML: .*'x' is not a valid int"),
    "a truth that is none": ("a: !!bool x\n", ":1: not valid YAML: .*'x' is not a valid bool"),
    "an octal that is said to be one": ("a: !!int 010\n", ":1: not valid YAML: '010' is not a valid int"),
    "a number of many digits": ("a: " + "9" * 5000 + "\n", ":1: not valid YAML: .*is not a valid int"),
    "a list for a key": ("? [1]\n: 2\n", ":1: not valid YAML: .*a key must be text or a number"),
    "a merge": ("a: {<<: {b: 1}}\n", ":1: not valid YAML: .*merge"),
    "two documents": (
        "a: 1\n---\nb: 2\n",
        ":2: not valid YAML: expected a single document in the stream.*but found another",
    ),
    "a byte that is none": ("a: \x01\n", "special characters are not allowed"),
    "a list": ("- 1\n", "must be a mapping at the top level"),
    "nothing": ("", "must be a mapping at the top level"),
    "too much": ("#" * (LARGEST_FILE + 1), f"more than {LARGEST_FILE} bytes"),
}


@pytest.mark.parametrize(("text", "reason"), REFUSED.values(), ids=list(REFUSED))
def test_what_is_refused_is_refused_in_one_line(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "p.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigurationError, match=f"p.yaml.*{reason}") as caught:
        read_yaml(path)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 500


@pytest.mark.parametrize(
    ("written", "read"),
    [
        ("1e-3", 1e-3),
        ("-2E+1", -20.0),
        ("1.5e3", 1500.0),
        (".5e-1", 0.05),
        ("7", 7),
        ("-.inf", -inf),
        ("1e", "1e"),
    ]
    + [("0x1F", 31), ("1_000", 1000), ("010.5", 10.5)]
    + [(text, text) for text in ("010", "-07", "1:30", "190:20:30", "1:30.5")],
)
def test_numbers_are_read_as_written(written: str, read: object) -> None:
    """As ROS reads them; never as the octal and sexagesimal numbers of YAML 1.1."""
    loaded = load(f"a: {written}\n")["a"]
    assert loaded == read and type(loaded) is type(read)


def test_a_pipe_is_not_waited_for() -> None:
    with pytest.raises(ConfigurationError, match="cannot read /dev/zero: must be a regular file"):
        read_yaml(Path("/dev/zero"))


def test_a_pipe_is_named_as_written(capsys: pytest.CaptureFixture[str]) -> None:
    """As for ``--schedule <(...)``: a run reads its files several times, in several processes."""
    reading, writing = os.pipe()
    for option in ("--schedule", "--robot", "--params-file"):
        assert main(["simulate", option, f"/dev/fd/{reading}"]) == 2
        expected = f"error: cannot read /dev/fd/{reading}: must be a regular file, not a pipe or device"
        assert capsys.readouterr().err.splitlines()[-1].endswith(expected)
    os.close(reading)
    os.close(writing)


def test_aliases_of_reasonable_size_are_read() -> None:
    loaded = load("a: &a {x: 1}\nb: [*a, *a]\n")
    assert loaded == {"a": {"x": 1}, "b": [{"x": 1}, {"x": 1}]}


def test_keys_know_their_lines_and_come_back_as_yaml() -> None:
    loaded = load("a: 1\n\nb:\n  c: 2\n")
    assert (loaded.line, loaded.lines) == (1, {"a": 1, "b": 3})
    assert (loaded["b"].line, loaded["b"].lines) == (4, {"c": 4})
    assert yaml.safe_load(yaml.safe_dump(loaded)) == {"a": 1, "b": {"c": 2}}


PARAMETERS = {
    "a wrong type": ("controller:\n  ros__parameters:\n    law: 3\n", r"p.yaml:3: parameter 'law': unknown"),
    "out of range": ("plant:\n  ros__parameters:\n    resend_after: -1.0\n", r"p.yaml:3: parameter 'resend_"),
    "an unknown one": (
        "controller:\n  ros__parameters:\n    lwa: pid\n",
        r"p.yaml:3: unknown parameter 'lwa' \(did you mean 'law'\?\)",
    ),
    "a node misspelt": (
        "contoller:\n  ros__parameters: {law: pid}\n",
        r"p.yaml:1: unknown node 'contoller' \(did you mean 'controller'\?\)",
    ),
}


@pytest.mark.parametrize(("text", "reason"), PARAMETERS.values(), ids=list(PARAMETERS))
def test_a_bad_parameter_is_named_with_its_line(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "p.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigurationError, match=reason):
        load_parameters(files=[path])


def test_nodes_of_others_may_have_their_section(tmp_path: Path) -> None:
    path = tmp_path / "p.yaml"
    path.write_text("camera:\n  ros__parameters: {exposure: 3}\n", encoding="utf-8")
    assert load_parameters(files=[path]) == load_parameters()


def test_an_override_is_not_blamed_on_a_file(tmp_path: Path) -> None:
    path = tmp_path / "p.yaml"
    path.write_text("controller:\n  ros__parameters: {law: pid}\n", encoding="utf-8")
    with pytest.raises(UnknownNameError, match=r"^controller: parameter 'law'"):
        load_scenario("colliding", {"controller": {"law": "pdi"}}, files=[path])
