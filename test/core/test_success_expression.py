"""Success expressions: what holds, what is no expression, and why one does not hold."""

from math import isnan

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sms_handover.campaign.definition.success_expression import success_expression
from sms_handover.errors import ConfigurationError

METRICS = {"a": 2.0, "b.c": -1.0, "none": None, "odd name": 0.5}


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("a > 1 and b.c < 0", True),
        ("1 < a <= 2", True),
        ("not a == 2 or abs(b.c) * 3 - 1 == a", True),
        ("min(a, b.c, 5) == -1 and max(a, 1) / 2 == 1", True),
        ("'odd name' < 1", True),
        ("true and not false", True),
        ("none < 1", False),
        ("none != 1 or 1 != none", False),
        ("not none < 1", False),
        ("not (a < 1 or none > 1)", False),
        ("not (a < 1 and none > 1)", True),
        ("none > 1 or a == 2", True),
        ("none > 1 and a == 2", False),
        ("not none", False),
        ("none", False),
        ("max(1, none) > 0", False),
        ("a / (b.c + 1) > 1", False),
    ],
)
def test_an_expression_is_judged(text: str, holds: bool) -> None:
    assert success_expression(text).holds(METRICS) is holds


@pytest.mark.parametrize(
    "text",
    [
        "().__class__",
        "a.__class__()",
        "[a for a in b]",
        "lambda: 1",
        "a if b else c",
        "open('x')",
        "a[0]",
        "f'{a}'",
        "a ** 9 ** 9 ** 9",
        "(b := a)",
        "min(a)",
        "abs(x=1)",
        "1j",
        "a < 1e999",
        f"a * {'9' * 400} < 1",
        "a / 0 > 1",
        "a / (1 - 1) > 1",
        "(" * 400 + "1" + ")" * 400,
        "x" * 2000,
        "",
    ],
)
def test_anything_else_is_no_expression(text: str) -> None:
    with pytest.raises(ConfigurationError, match="success"):
        success_expression(text)


@settings(max_examples=200, deadline=None)
@given(st.text(alphabet="ab.()<>=!+-*/ '0123456789andortmix,", max_size=30))
def test_no_text_does_anything_but_be_judged_or_rejected(text: str) -> None:
    try:
        found = success_expression(text)
    except ConfigurationError:
        return
    found.holds(dict.fromkeys(found.names, 1.0))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("a < 1", "not a < 1 (a is 2)"),
        ("none < 1 and (a < 1 or b.c > 0) and a < 0", "not a < 1 or b.c > 0 (a is 2, b.c is -1)"),
        ("none < 1 and a == 2", "not none < 1 (none is not defined)"),
        ("none < 1 or a != 2", "not none < 1 or a != 2 (none is not defined, a is 2)"),
        ("zero and a > 5", "not zero"),
        (f"max(a, {'1, ' * 60}1) < 1", f"not max(a, {'1, ' * 37}1,... (a is 2)"),
    ],
)
def test_why_an_expression_does_not_hold(text: str, told: str) -> None:
    """By its first false part, or else its first one that is not defined."""
    assert success_expression(text).why_not({**METRICS, "zero": 0.0}) == told


def test_metrics_of_an_expression_must_be_known() -> None:
    assert success_expression("a and b.c > a").names == ("a", "b.c")
    with pytest.raises(ConfigurationError, match=r"unknown metric 'b.d' \(did you mean 'b.c'\?\)"):
        success_expression("a < b.d").require_known(dict.fromkeys(METRICS))
    assert isnan(success_expression("none").tree.of(METRICS))
