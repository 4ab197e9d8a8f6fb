"""YAML that is not data for us is refused in one line that names the place, quickly and in little memory."""

from pathlib import Path

import pytest
import yaml

from sms_handover.configuration.parameters import read_yaml
from sms_handover.configuration.yaml_reader import LARGEST_FILE, load
from sms_handover.errors import ConfigurationError, UnknownNameError
from sms_handover.simulation.scenario import load_parameters, load_scenario

BOMB = "a: &a [lol, lol, lol, lol, lol, lol, lol, lol, lol]\n" + "".join(
    f"{chr(97 + n)}: &{chr(97 + n)} [{', '.join([f'*{chr(96 + n)}'] * 9)}]\n" for n in range(1, 9)
)

REFUSED = {
    "a key twice": ("a: 1\nb: 2\na: 3\n", "key 'a' is given twice.*line 3"),
    "a key twice inside": ("a:\n  b: 1\n  b: 2\n", "key 'b' is given twice.*line 3"),
    "a bomb of aliases": (BOMB, "written out it is too large.*line 6"),
    "itself": ("a: &a [1, *a]\n", "refers to what it is in.*line 1"),
    "levels": ("a: " + "[" * 40 + "]" * 40, "more than 32 levels.*line 1"),
    "very many levels": ("a: " + "[" * 100_000, "more than 32 levels.*line 1"),
    "an object": ("a: !!python/object/apply:os.system [ls]\n", "could not determine a constructor.*line 1"),
    "a date that is none": ("a: 2001-13-45\n", "not a value of its kind: month must be in 1..12.*line 1"),
    "a number that is none": ("a: !!int x\n", "'x' is not a value of its kind.*line 1"),
    "a truth that is none": ("a: !!bool x\n", "'x' is not a value of its kind.*line 1"),
    "a number of many digits": ("a: " + "9" * 5000 + "\n", "not a value of its kind.*line 1"),
    "a list for a key": ("? [1]\n: 2\n", "a key must be a word or a number.*line 1"),
    "a merge": ("a: {<<: {b: 1}}\n", "merge.*line 1"),
    "two documents": ("a: 1\n---\nb: 2\n", "expected a single document.*line 2"),
    "a byte that is none": ("a: \x01\n", "special characters are not allowed"),
    "a list": ("- 1\n", "expected a mapping at the top level"),
    "nothing": ("", "expected a mapping at the top level"),
    "too much": ("#" * (LARGEST_FILE + 1), f"more than {LARGEST_FILE} bytes"),
}


@pytest.mark.parametrize(("text", "reason"), REFUSED.values(), ids=list(REFUSED))
def test_what_is_refused_is_refused_in_one_line(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "p.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigurationError, match=f"p.yaml.*{reason}") as caught:
        read_yaml(path)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 500


def test_a_pipe_is_not_waited_for() -> None:
    with pytest.raises(ConfigurationError, match="cannot read /dev/zero: not a file of bytes"):
        read_yaml(Path("/dev/zero"))


def test_aliases_of_reasonable_size_are_read() -> None:
    loaded = load("a: &a {x: 1}\nb: [*a, *a]\n")
    assert loaded == {"a": {"x": 1}, "b": [{"x": 1}, {"x": 1}]}


def test_keys_know_their_lines_and_come_back_as_yaml() -> None:
    loaded = load("a: 1\n\nb:\n  c: 2\n")
    assert loaded.lines == {"a": 1, "b": 3} and loaded["b"].lines == {"c": 4}
    assert yaml.safe_load(yaml.safe_dump(loaded)) == {"a": 1, "b": {"c": 2}}


PARAMETERS = {
    "a wrong type": ("controller:\n  ros__parameters:\n    law: 3\n", r"p.yaml:3: parameter 'law' is 3"),
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
        load_scenario({"controller": {"law": "pdi"}}, [path])
