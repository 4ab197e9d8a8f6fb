"""A real Chromium for the tests of pages, and what it complained about."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

from .chromium import ARGUMENTS, WIDE, absence, find_chromium, is_needed

_OWN_SCHEMES = ("data:", "blob:", "about:")


class Visit:
    """An open page, with every error it reported and every request it made since."""

    def __init__(self, page: Page) -> None:
        """Listen to the page before it loads anything."""
        self.page = page
        self.errors: list[str] = []
        self.requests: list[str] = []
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("console", lambda said: self.errors.append(said.text) if said.type == "error" else None)
        page.on("request", lambda request: self._note(request.url))

    def _note(self, url: str) -> None:
        """Keep the address of a request that leaves the page."""
        if not url.startswith(_OWN_SCHEMES):
            self.requests.append(url)


class Browsing:
    """Opens pages in one browser, each in a context of its own."""

    def __init__(self, browser: Browser, folder: Path) -> None:
        """Take the browser and a folder for the pages."""
        self.browser = browser
        self._folder = folder
        self._opened: list[Visit] = []

    def open(
        self,
        html: str,
        *,
        size: tuple[int, int] = WIDE,
        dark: bool = False,
        before: str = "",
        touch: bool = False,
        mobile: bool = False,
    ) -> Visit:
        """Open a page from a file of its own, as a user does; ``before`` is a script that runs first."""
        file = self._folder / f"page_{len(self._opened)}.html"
        file.write_text(html, encoding="utf-8")
        context = self.browser.new_context(
            viewport={"width": size[0], "height": size[1]},
            color_scheme="dark" if dark else "light",
            has_touch=touch,
            is_mobile=mobile,
            offline=True,
        )
        visit = Visit(context.new_page())
        self._opened.append(visit)
        if before:
            visit.page.add_init_script(before)
        visit.page.goto(file.as_uri())
        visit.requests.remove(file.as_uri())
        return visit

    def close(self) -> None:
        """Close every page."""
        for visit in self._opened:
            visit.page.context.close()


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """A headless Chromium that draws 3D on the processor."""
    executable = find_chromium()
    if executable is None and is_needed():
        pytest.fail(absence())
    if executable is None:
        pytest.skip(absence())
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=executable, args=list(ARGUMENTS))
        yield chromium
        chromium.close()


@pytest.fixture
def browsing(browser: Browser, tmp_path: Path) -> Iterator[Browsing]:
    """Give ``browsing.open(html, size=..., dark=...)``; pages are closed after the test."""
    opened = Browsing(browser, tmp_path)
    yield opened
    opened.close()
