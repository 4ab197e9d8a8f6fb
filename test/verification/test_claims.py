"""The paper's claims, judged on a whole handover under each law."""

from functools import cache
from math import isnan

import pytest

from sms_handover.analysis.claims import Claim
from sms_handover.analysis.clearance import TaskTexts
from sms_handover.analysis.comparison import compare
from sms_handover.run_data import RunData
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.simulate import simulate
from test.evidence import Record, Table

_COMMAND = (
    "`make handover` records both runs over DDS and prints the same figures; each here is of `simulate()`"
)


@cache
def handover(law: str) -> RunData:
    """Return the whole handover of the paper under a law, simulated once per session."""
    return simulate(_scenario(law))


def _scenario(law: str) -> Scenario:
    return load_scenario("paper", {"law": law})


@pytest.fixture(scope="module")
def claims() -> tuple[Claim, ...]:
    """The verdicts on a run under each law, with the bodies that must not enter each other."""
    truth = {law: _scenario(law).truth for law in ("nmpc", "pid")}
    texts = {law: TaskTexts(true.robot.urdf, true.schedule.text) for law, true in truth.items()}
    return compare({law: handover(law) for law in truth}, texts=texts).claims


def test_every_claim_holds(claims: tuple[Claim, ...], record: Record) -> None:
    """A claim counts 0 where it holds and 1 where it does not."""
    assert claims
    for claim in claims:
        record(claim.text, float(not claim.holds), 0.0, against=f'"{claim.paper}"')


def test_the_table_of_claims(claims: tuple[Claim, ...], table: Table) -> None:
    """Claim by claim: the paper's words, our figures under both laws, the verdict."""
    rows = [
        _COMMAND + ".",
        "",
        "| claim, and the paper's words | NMPC | PID | verdict |",
        "|---|---|---|---|",
    ]
    for claim in claims:
        verdict = "holds" if claim.holds else "**does not hold**"
        rows.append(f'| **{claim.name.replace("_", " ")}**: "{claim.paper}" | | | {verdict} |')
        for item in claim.findings:
            rows.append(f"| {item.label} [{item.unit}] | {_number(item.nmpc)} | {_number(item.pid)} | |")
    table("\n".join(rows))


def _number(value: float) -> str:
    return "never" if isnan(value) else f"{value:.4g}"
