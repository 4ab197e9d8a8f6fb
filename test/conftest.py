"""The fixtures by which a test hands in what it measured, for docs/verification.md."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from test.evidence import Evidence, Ledger, Record, Table

_LEDGER = pytest.StashKey[Ledger]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that keeps the evidence of a session."""
    parser.addoption("--evidence", type=Path, default=None, help="write what was measured to this JSON file")


def pytest_configure(config: pytest.Config) -> None:
    """Begin an empty ledger."""
    config.stash[_LEDGER] = Ledger()


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Write the ledger if it was asked for."""
    path = session.config.getoption("--evidence", default=None)
    if path is not None:
        session.config.stash[_LEDGER].write(path)


@pytest.fixture
def record(request: pytest.FixtureRequest) -> Iterator[Record]:
    """Give ``record(claim, value, bound, unit=..., against=...)``: keeps a number, fails beyond its bound."""
    broken: list[Evidence] = []

    def keep(claim: str, value: float, bound: float, *, unit: str = "-", against: str) -> None:
        section = (request.module.__doc__ or request.module.__name__).strip().splitlines()[0]
        entry = Evidence(section, claim, float(value), float(bound), unit, against, request.node.nodeid)
        request.config.stash[_LEDGER].entries.append(entry)
        if not entry.holds:
            broken.append(entry)

    yield keep
    if broken:
        pytest.fail("; ".join(f"{e.claim}: {e.value:.3g} {e.unit}, bound {e.bound:.3g}" for e in broken))


@pytest.fixture
def table(request: pytest.FixtureRequest) -> Table:
    """Give ``table(markdown)``: a whole table for the section of the test."""

    def keep(markdown: str) -> None:
        section = (request.module.__doc__ or request.module.__name__).strip().splitlines()[0]
        request.config.stash[_LEDGER].tables[section] = markdown

    return keep
