"""The site of `make docs`: every link leads somewhere, every page is whole at a desk and on a telephone."""

from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page

from ..browser.chromium import NARROW, WIDE
from .html_links import dead_links, read

SOURCE_PAGES = "_modules"  # the code itself, of which one page is looked at
WIDER_THAN_THE_PAGE = """() => [...document.querySelectorAll('body *')]
    .filter((e) => e.getBoundingClientRect().right > innerWidth + 1)
    .filter((e) => !e.closest(".math, pre, .table-wrapper"))
    .filter((e) => getComputedStyle(e).position !== 'fixed' && !e.closest('aside'))
    .slice(0, 3).map((e) => e.outerHTML.slice(0, 120))"""


def pages_of(site: Path) -> list[Path]:
    pages = sorted(site.rglob("*.html"))
    code = [page for page in pages if SOURCE_PAGES in page.parts]
    return [*(page for page in pages if page not in code), code[0]]


def test_every_link_leads_somewhere(site: Path) -> None:
    assert len(pages_of(site)) > 40
    assert dead_links(site) == []


def test_dead_links_are_noticed(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text('<a href="b.html#there"></a><a href="b.html#not"></a><img src="c.png">')
    (tmp_path / "b.html").write_text(
        '<p id="there"></p><a href="#there"></a><a href="https://example.org/x"></a>'
    )
    assert dead_links(tmp_path) == ["a.html: b.html#not", "a.html: c.png"]


def test_every_public_module_is_in_the_api(site: Path) -> None:
    package = Path(__file__).parents[2] / "sms_handover"
    listed = read(site / "py-modindex.html").found
    for file in package.rglob("*.py"):
        parts = file.relative_to(package.parent).with_suffix("").parts
        module = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        assert any(link.endswith(f"#module-{module}") for link in listed), module


@pytest.mark.browser
@pytest.mark.parametrize(("size", "dark"), [(WIDE, False), (NARROW, True)], ids=["desk", "telephone"])
def test_every_page_opens_whole(site: Path, browser: Browser, size: tuple[int, int], dark: bool) -> None:
    """No error, nothing from the network, nothing beyond the edge."""
    width, height = size
    context = browser.new_context(
        viewport={"width": width, "height": height}, color_scheme="dark" if dark else "light", offline=True
    )
    page = context.new_page()
    said: list[str] = []
    page.on("pageerror", lambda error: said.append(f"{page.url}: {error}"))
    page.on("console", lambda m: said.append(f"{page.url}: {m.text}") if m.type == "error" else None)
    page.on("requestfailed", lambda r: said.append(f"{page.url}: {r.url}"))
    for file in pages_of(site):
        page.goto(file.as_uri())
        if page.evaluate("document.documentElement.scrollWidth") > width:
            said.append(f"{file.name} is wider than {width} px: {page.evaluate(WIDER_THAN_THE_PAGE)}")
    context.close()
    assert said == []


@pytest.mark.browser
def test_a_telephone_gets_to_every_section(site: Path, browser: Browser) -> None:
    page = narrow_page(browser, site)
    menu = page.locator(".sidebar-drawer")
    assert not is_in_sight(page, ".sidebar-tree")
    page.locator("label.nav-overlay-icon").first.click()
    page.wait_for_function("document.querySelector('.sidebar-drawer').getBoundingClientRect().left >= 0")
    captions = [text.lower() for text in menu.locator(".caption-text").all_inner_texts()]
    assert captions == ["tutorials", "how to", "reference", "explanation", "the project"]
    menu.get_by_role("link", name="Commands", exact=True).click()
    assert page.locator("h1").inner_text().startswith("Commands")
    page.context.close()


@pytest.mark.browser
def test_the_search_finds_a_metric_and_a_function(site: Path, browser: Browser) -> None:
    page = narrow_page(browser, site)
    for words, expected in (("settling time", "Metrics"), ("reduced_dynamics", "reduced_dynamics")):
        page.goto(f"{(site / 'search.html').as_uri()}?q={words}")
        page.get_by_role("link", name=expected).first.wait_for()
    page.context.close()


def narrow_page(browser: Browser, site: Path) -> Page:
    """Return the front page on a telephone."""
    context = browser.new_context(viewport={"width": NARROW[0], "height": NARROW[1]}, offline=True)
    page = context.new_page()
    page.goto((site / "index.html").as_uri())
    return page


def is_in_sight(page: Page, selector: str) -> bool:
    """Whether an element is within the window."""
    box = page.locator(selector).first.bounding_box()
    return box is not None and box["x"] + box["width"] > 0
