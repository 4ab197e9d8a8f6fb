"""The page of a campaign in a real browser: drawn, without a network, whole on a telephone, not too large."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from sms_handover.campaign.cases.case_row import Beside, Row, Status, Task
from sms_handover.campaign.page.campaign_page import campaign_page
from sms_handover.campaign.record.campaign_folder import CampaignFolder
from sms_handover.campaign.record.journal import Entry, JournalFaults

from ..core.campaigns import MASS, STUB, run_here, written
from .chromium import NARROW, WIDE
from .conftest import Browsing

pytestmark = pytest.mark.browser

X = "deputy.in_world.xyz[0]"
EVIL = "</script><script>throw evil</script>"
LARGEST_MB = 15.0  # of 10 000 cases


class MadeUp(CampaignFolder):
    """A folder with made-up rows of many cases, one in seven a failure, one in fifty without numbers."""

    count = 400

    def entries(self, faults: JournalFaults | None = None) -> Iterator[Entry]:
        """Yield the rows."""
        for case in range(self.count):
            for law, factor in (("nmpc", 1.0), ("pid", 1.3)):
                share = case * 0.618034 % 1.0
                metrics: dict[str, float | None] = {
                    "grasp_error": factor * (0.001 + 0.002 * share),
                    "base_turn": 0.01 / factor + 0.001 * (case % 13),
                    "control_effort": 10.0 * factor + share,
                    "clearance": 0.02 - 0.01 * share,
                }
                good = case % 7 != 3
                status = Status.SUCCEEDED if good else Status.MISSION_FAILED
                row = Row(
                    Task(case, "smooth", law),
                    case,
                    {MASS: 240.0 + 30.0 * (share - 0.5), X: 1.05 + 0.001 * (case % 11)},
                    status if case % 50 else Status.NUMERIC_FAILURE,
                    "" if good and case % 50 else f"{EVIL} missed by {case} mm, joint_{case % 13}",
                    metrics if case % 50 else {},
                    "00",
                )
                yield Entry(row, Beside(1.0, 1.0, "host"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> MadeUp:
    """A folder of a campaign with two laws and two draws."""
    path = tmp_path_factory.mktemp("campaign")
    draws = {MASS: {"normal": {"mean": 240, "std": 9}}, X: {"uniform": {"low": 1.05, "high": 1.06}}}
    run_here(
        written(path / "file", draws=draws, laws=["nmpc", "pid"], sampler="lhs"), path / "out", program=STUB
    )
    return MadeUp(Path(path / "out"))


@pytest.fixture(scope="module")
def html(folder: MadeUp) -> str:
    """The page of that folder."""
    return campaign_page(folder)


@pytest.mark.parametrize("size", [WIDE, NARROW])
def test_it_opens_whole_and_without_a_network(browsing: Browsing, html: str, size: tuple[int, int]) -> None:
    visit = browsing.open(html, size=size, dark=size is NARROW, touch=size is NARROW)
    visit.page.evaluate("async () => { await drawn; }")
    assert visit.errors == [] and visit.requests == []
    assert visit.page.evaluate("document.documentElement.scrollWidth") <= size[0]
    frames = "[...document.querySelectorAll('.plot .frame')]"
    drawn = f"{frames}.map((frame) => frame.querySelectorAll('.trace').length)"
    # success with two bounds, and distribution, two trades, a map of each law; bars are traces of their own
    assert visit.page.evaluate(drawn) == [6, 2, 2, 2, 1, 1]
    captions = visit.page.locator(".plot figcaption").all_inner_texts()
    assert [text for text in captions if "over two draws" in text] == [
        f"smooth: cases under {law} over two draws, what is no success hollow" for law in ("nmpc", "pid")
    ]
    assert visit.page.locator("#worst details").count() == 10
    failures = visit.page.locator("#failures")
    assert EVIL in failures.inner_text() and failures.locator("tbody tr").count() == 20
    assert failures.locator("tbody th").first.inner_text() == "smooth"
    assert "more causes, of" in failures.inner_text()
    notes = visit.page.locator("#summary").inner_text()
    assert "intervals by order statistics" in notes and "Cases of lhs are spread evenly" in notes


def test_ten_thousand_cases_are_no_large_page(folder: MadeUp, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(folder, "count", 10_000)
    page = campaign_page(folder)
    assert len(page.encode()) / 1e6 < LARGEST_MB
    assert "10000" in page
