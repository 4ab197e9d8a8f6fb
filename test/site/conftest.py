"""Where the site is that `make docs` has built, and a browser to look at it."""

from pathlib import Path

import pytest

from ..browser.conftest import browser

__all__ = ["browser"]


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--site", type=Path, required=True, help="folder of the built site")


@pytest.fixture(scope="session")
def site(request: pytest.FixtureRequest) -> Path:
    """The folder of the built site."""
    folder: Path = request.config.getoption("--site")
    return folder.resolve()
