"""What a node has decided, in words."""

from dataclasses import replace
from pathlib import Path

import pytest

from sms_handover.graph import events
from sms_handover.graph.events import RunEvent, Severity, graver_in_words

EVENT = RunEvent(2_500_000_000, "plant", "command_lost", Severity.WARNING, "no command comes")


@pytest.mark.parametrize(
    ("figures", "words"),
    [
        ({}, "no command comes"),
        ({"value": 0.25, "unit": "s"}, "no command comes; value 0.25 s"),
        ({"value": 3.0, "limit": 2.0}, "no command comes; value 3; limit 2"),
    ],
)
def test_an_event_tells_time_kind_node_and_figures(figures: dict[str, object], words: str) -> None:
    event = replace(EVENT, **figures)  # type: ignore[arg-type]
    assert str(event) == f"  2.50 s  warning command_lost (plant): {words}"


def test_warnings_and_errors_are_counted() -> None:
    error, info = replace(EVENT, severity=Severity.ERROR), replace(EVENT, severity=Severity.INFO)
    assert graver_in_words([]) == graver_in_words([info]) == ""
    assert graver_in_words([EVENT, info]) == "1 warning"
    assert graver_in_words([EVENT, error, EVENT]) == "1 error, 2 warnings"


def test_every_kind_is_in_the_table_of_the_document() -> None:
    kinds = [v for name, v in vars(events).items() if name.isupper() and isinstance(v, str)]
    assert len(kinds) >= 10
    table = (Path(__file__).parents[2] / "docs" / "watchdogs.md").read_text(encoding="utf-8")
    rows = [line for line in table.splitlines() if line.startswith("| ")]
    missing = [kind for kind in kinds if not any(f"`{kind}`" in row for row in rows)]
    assert missing == []
