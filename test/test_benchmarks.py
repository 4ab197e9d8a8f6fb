"""The frame that every benchmark stands in: what it finds is written, read back and rendered unchanged."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from benchmarks.performance import SCRIPTS, document
from benchmarks.results import ROOT, Result, Table, load, number, publish
from benchmarks.timing import Timings, interleaved


@pytest.fixture
def result() -> Result:
    return Result(
        name="growth",
        question="How fast?",
        tables=[Table(["who", "time [us]"], [["ours | theirs", "12.5"]])],
        notes=["A note."],
        diagrams=["pace.svg"],
        values={"us": 12.5},
    )


def test_a_result_survives_its_file(result: Result, tmp_path: Path) -> None:
    publish(result, tmp_path)
    again = load(tmp_path / "growth.json")
    assert again == result


def test_the_document_has_every_part_of_a_result(result: Result) -> None:
    text = document([result], ["Machine: a machine"])
    for part in (
        "- Machine: a machine",
        "## How fast?",
        "A note.",
        "| who | time [us] |",
        "(images/pace.svg)",
    ):
        assert part in text
    assert "| ours \\| theirs | 12.5 |" in text


def test_what_is_not_measured_again_stays_in_the_document(result: Result) -> None:
    """In the order of the scripts; a section that was measured takes the place of the one before."""
    other = replace(result, name="engines", question="Against others?")
    page = document([result, other], ["Machine: a machine"])
    again = document([replace(result, notes=["Another note."])], ["Machine: a machine"], page)
    assert again == page.replace("A note.", "Another note.", 2).replace("Another note.", "A note.", 1)
    assert again.index("## Against others?") < again.index("## How fast?")


def test_a_row_of_another_width_is_refused() -> None:
    with pytest.raises(ValueError, match="2 columns, but a row has 1"):
        Table(["who", "time [us]"], [["ours"]])


def test_contestants_take_turns_and_the_first_round_does_not_count() -> None:
    order: list[str] = []
    times = interleaved({name: partial(order.append, name) for name in "ab"}, rounds=2)
    assert order == ["a", "b"] * 3
    assert {name: len(seconds) for name, seconds in times.seconds.items()} == {"a": 2, "b": 2}


def test_a_ratio_is_of_the_same_round() -> None:
    """A machine that slows down to a third between rounds does not change who is how much faster."""
    times = Timings({"a": (2.0, 6.0, 6.0), "b": (1.0, 3.0, 3.0)})
    assert times.ratio("a", "b") == 2.0
    assert (times.best("a"), times.median("a")) == (2.0, 6.0)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (123456.0, "123456"),
        (12.345, "12.3"),
        (0.012345, "0.0123"),
        (9.9996, "10.00"),
        (1.5e-7, "1.50e-07"),
        (0.0, "0"),
    ],
)
def test_numbers_keep_three_digits(value: float, text: str) -> None:
    assert number(value) == text


def test_every_benchmark_listed_exists() -> None:
    assert [name for name in SCRIPTS if not (ROOT / "benchmarks" / f"{name}.py").is_file()] == []
