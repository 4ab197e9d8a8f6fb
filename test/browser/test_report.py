"""The report in a real browser: drawn, linked, safe, without a network, and whole on a telephone."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page

from sms_handover.report.page import report_page
from sms_handover.report.recorded_run import RecordedRun, read_recorded
from sms_handover.units import ns_to_seconds

from ..core.report_bags import write_handovers
from ..core.test_report_page import EVIL, evil_bag
from .chromium import NARROW, WIDE
from .conftest import Browsing, Visit

pytestmark = pytest.mark.browser

NEAR = 1e-6  # s
PATIENCE_MS = 60_000  # ms until a page that does not do what it should is given up
LARGEST_IN_SIGHT = """() => {
  const { lines, view } = plots.plots[0];
  const [begin, end] = view.range;
  const inSight = ({ time, values }) => [...values].filter((_, i) => time[i] >= begin && time[i] < end);
  return Math.max(...lines.flatMap(inSight));
}"""

Open = Callable[..., Visit]


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[RecordedRun]:
    """A short handover under each law, recorded."""
    bags = write_handovers(tmp_path_factory.mktemp("handovers"))
    return [read_recorded(law, bag) for law, bag in bags.items()]


@pytest.fixture(scope="module")
def html(runs: list[RecordedRun]) -> str:
    """The report of both."""
    return report_page(runs)


@pytest.fixture
def opened(browsing: Browsing, html: str) -> Open:
    """Open the report and wait until everything is drawn."""

    def open_report(page: str = html, **options: Any) -> Visit:
        visit = browsing.open(page, **options)
        settle(visit.page)
        return visit

    return open_report


def settle(page: Page) -> None:
    """Wait until the plots show what they were told to."""
    page.evaluate("async () => { await drawn; await plots.work; }")


def until(page: Page, condition: str) -> None:
    """Wait until an expression is true; the page's policy forbids the way Playwright would do it."""
    page.evaluate(f"""async () => {{
        const latest = performance.now() + {PATIENCE_MS};
        while (!({condition})) {{
            if (performance.now() > latest) throw new Error("it never came true");
            await new Promise(requestAnimationFrame);
        }}
    }}""")


def ranges(page: Page) -> list[list[float]]:
    """Return the stretch of time that each plot shows."""
    found: list[list[float]] = page.evaluate("plots.plots.map((plot) => plot.frame.layout.xaxis.range)")
    return found


def frame_of(page: Page, key: str) -> dict[str, float]:
    """Scroll to a plot and return where its frame is."""
    frame = page.locator(f"[data-plot='{key}'] .frame")
    frame.scroll_into_view_if_needed()
    box = frame.bounding_box()
    assert box is not None
    x, y, width, height = box["x"], box["y"], box["width"], box["height"]
    return {"x": x, "width": width, "middle": y + height / 2}


@pytest.mark.parametrize("size", [WIDE, NARROW])
@pytest.mark.parametrize("dark", [False, True])
def test_it_opens_whole_and_without_a_network(
    opened: Open, runs: list[RecordedRun], size: tuple[int, int], dark: bool
) -> None:
    visit = opened(size=size, dark=dark, touch=size is NARROW)
    page = visit.page
    assert visit.errors == [] and visit.requests == []
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
    assert page.locator(".plot .frame").count() == page.evaluate("report.plots.length") == 17
    traces = page.evaluate(
        "plots.plots.map((plot) => plot.frame.querySelectorAll('.scatterlayer .trace').length)"
    )
    # position and orientation error of two arms, torques, errors of joints, base, conservation, clearance
    per_run = [1, 1, 1, 1, 7, 7, 7, 7, 3, 3, 1, 1, 1, 1, 3, 1, 5]
    assert traces == [len(runs) * count for count in per_run]


def test_many_runs_with_long_names_fit_a_telephone(opened: Open, runs: list[RecordedRun]) -> None:
    """Tables that are too wide scroll by themselves; the page does not."""
    names = [f"{run.law} with a rather long name, number {number}" for number in range(3) for run in runs]
    many = [replace(runs[place % 2], name=name) for place, name in enumerate(names)]
    visit = opened(report_page(many), size=NARROW, touch=True)
    assert visit.page.evaluate("document.documentElement.scrollWidth") == NARROW[0]
    wide = (
        "[...document.querySelectorAll('.scroll')].filter((box) => box.scrollWidth > box.clientWidth).length"
    )
    assert visit.page.evaluate(wide) > 0
    assert visit.errors == []


def test_colours_follow_the_scheme_of_the_system(opened: Open) -> None:
    page = opened().page
    line = "plots.plots[0].frame.querySelector('.scatterlayer .trace path').style.stroke"
    light = page.evaluate(line)
    page.emulate_media(color_scheme="dark")
    until(page, f"{line} !== {light!r}")
    settle(page)
    assert page.evaluate("document.documentElement.scrollWidth") == WIDE[0]


def test_a_zoom_in_one_plot_is_a_zoom_in_all(opened: Open) -> None:
    visit = opened()
    page = visit.page
    whole = page.evaluate("report.span")
    assert ranges(page) == [whole] * len(ranges(page))
    box = frame_of(page, "arm_a/joint_torque")
    left, right = box["x"] + 200, box["x"] + 350
    page.mouse.move(left, box["middle"])
    page.mouse.down()
    page.mouse.move(right, box["middle"], steps=5)
    page.mouse.up()
    settle(page)
    zoomed = ranges(page)
    assert zoomed == [zoomed[0]] * len(zoomed)
    assert whole[0] < zoomed[0][0] < zoomed[0][1] < whole[1]
    expected = 150 / (box["width"] - 84) * (whole[1] - whole[0])  # px of 84 px less than the frame's width
    assert zoomed[0][1] - zoomed[0][0] == pytest.approx(expected, rel=0.05)
    page.mouse.dblclick(left, box["middle"])
    settle(page)
    assert ranges(page) == [whole] * len(zoomed)
    assert visit.errors == []


def test_the_buttons_lead_to_phases_and_grasps(opened: Open, runs: list[RecordedRun]) -> None:
    page = opened().page
    spans = {phase["name"]: [phase["begin"], phase["end"]] for phase in page.evaluate("report.phases")}
    assert list(spans) == ["approach", "carry", "withdraw"]
    for name, span in spans.items():
        page.get_by_role("button", name=name, exact=True).click()
        settle(page)
        assert all(shown == pytest.approx(span, abs=NEAR) for shown in ranges(page))
        assert page.locator(".ranges [aria-pressed=true]").all_inner_texts() == [name]
    marks = [text.strip() for text in page.locator(".ranges button").all_inner_texts()]
    grasps = {ns_to_seconds(event.stamp_ns) for event in runs[0].data.grasp_events}
    decided = {ns_to_seconds(event.stamp_ns) for run in runs for event in run.data.run_events}
    assert marks[1 + len(spans) :] == [f"{time:g} s ± 1 s" for time in (*sorted(grasps), *sorted(decided))]


def test_the_values_in_sight_fill_the_height(opened: Open) -> None:
    page = opened().page
    heights = []
    for name in ("whole run", "approach"):
        page.get_by_role("button", name=name, exact=True).click()
        settle(page)
        low, high = page.evaluate("plots.plots[0].frame.layout.yaxis.range")
        largest = page.evaluate(LARGEST_IN_SIGHT)
        assert low <= 0.0 and largest < high < 1.2 * largest
        heights.append(high)
    assert heights[0] > heights[1]


def test_pointing_at_one_plot_shows_values_and_time_in_all(opened: Open) -> None:
    visit = opened()
    page = visit.page
    box = frame_of(page, "arm_a/position_error")
    until(page, "plots.visible.has(plots.plots[1])")
    page.mouse.move(box["x"] + 250, box["middle"])
    for place in (0, 1):
        label = f"plots.plots[{place}].frame.querySelector('.hoverlayer .legend')"
        until(page, label)
        text = page.evaluate(f"{label}.textContent")
        assert "nmpc" in text and "pid" in text and text.count(" mm") == 2
    time = page.evaluate("plots.plots[0].timeAt(250)")
    assert page.locator("#cursor-time").inner_text() == f"t = {time:.3f} s"
    cursors = page.evaluate(
        "plots.plots.map((plot) => [plot.cursor.isConnected, plot.cursor.style.visibility])"
    )
    assert cursors == [[True, "visible"]] * len(cursors)


def test_a_finger_scrolls_over_a_plot_and_taps_for_its_values(opened: Open) -> None:
    visit = opened(size=NARROW, touch=True, mobile=True)
    page = visit.page
    box = frame_of(page, "arm_a/position_error")
    devices = page.context.new_cdp_session(page)
    before = page.evaluate("scrollY")
    touches = [{"x": box["x"] + 150, "y": box["middle"] - 15 * step} for step in range(8)]
    for touch in touches:
        kind = "touchStart" if touch is touches[0] else "touchMove"
        devices.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [touch]})
    devices.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    until(page, f"scrollY > {before + 50}")
    assert ranges(page)[0] == page.evaluate("report.span")
    box = frame_of(page, "arm_a/position_error")
    page.touchscreen.tap(box["x"] + 150, box["middle"])
    until(page, "plots.plots[0].frame.querySelector('.hoverlayer .legend')")
    time = page.evaluate("plots.plots[0].timeAt(150)")
    assert page.locator("#cursor-time").inner_text() == f"t = {time:.3f} s"
    assert visit.errors == []


def test_runs_and_lines_can_be_hidden(opened: Open) -> None:
    page = opened().page
    drawn = "plots.plots[4].frame.querySelectorAll('.scatterlayer .trace').length"
    assert page.evaluate(drawn) == 14
    page.locator("[data-run='1']").uncheck()
    settle(page)
    assert page.evaluate(drawn) == 7
    page.locator("[data-plot='arm_a/joint_torque'] [data-series='0']").click()
    until(page, f"{drawn} === 6")
    assert page.evaluate("plots.plots[5].frame.querySelectorAll('.scatterlayer .trace').length") == 7


def test_magnitudes_can_be_drawn_on_a_logarithmic_scale(opened: Open) -> None:
    visit = opened()
    visit.page.locator("#logarithmic").check()
    settle(visit.page)
    kinds = visit.page.evaluate(
        "plots.plots.map((plot) => [plot.plot.magnitude, plot.frame.layout.yaxis.type])"
    )
    assert kinds == [[size, "log" if size else "linear"] for size, _ in kinds]
    assert [size for size, _ in kinds].count(True) == 8
    assert visit.errors == []


def test_the_animation_moves_and_shares_its_time_with_the_plots(opened: Open) -> None:
    visit = opened()
    page, inside = visit.page, visit.page.frames[1]
    page.locator("iframe").scroll_into_view_if_needed()
    end = inside.evaluate("player.end")
    poses, pictures = [], []
    for time in (0.0, end):
        inside.evaluate("t => player.seek(t)", time)
        drawn = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
        inside.evaluate(drawn)
        poses.append(
            inside.evaluate("""() => { const run = player.runs[0]; run.group.updateMatrixWorld(true);
            return run.bodies[run.body('arm_b_tool')].matrixWorld.elements.slice(12, 15) }""")
        )
        pictures.append(page.locator("iframe").screenshot())
    assert max(abs(a - b) for a, b in zip(*poses, strict=True)) > 1e-3  # m
    assert pictures[0] != pictures[1]
    assert page.evaluate("plots.chosen") == pytest.approx(end)
    box = frame_of(page, "base_speed")
    page.mouse.click(box["x"] + 300, box["middle"])
    time = page.evaluate("plots.plots.find((plot) => plot.plot.key === 'base_speed').timeAt(300)")
    page.evaluate("() => new Promise((done) => setTimeout(done))")  # the message is on its way
    assert inside.evaluate("player.t") == pytest.approx(time, abs=0.01)
    assert visit.errors == []


def test_clearance_is_drawn_with_the_lines_that_it_must_stay_above(opened: Open) -> None:
    visit = opened()
    frame_of(visit.page, "clearance")
    plot = "plots.plots.find((plot) => plot.plot.key === 'clearance')"
    shapes = visit.page.evaluate(
        f"{plot}.frame.layout.shapes.filter((s) => s.type === 'line').map((s) => s.y0)"
    )
    assert shapes == [0, -1]  # mm
    low, high = visit.page.evaluate(f"{plot}.frame.layout.yaxis.range")
    least = visit.page.evaluate(f"Math.min(...{plot}.lines.flatMap((line) => [...line.values]))")
    assert low < min(least, -1.0) and 0.0 < high < 250.0
    assert visit.errors == []


def test_nothing_in_a_bag_runs_as_a_script(opened: Open, tmp_path: Path) -> None:
    evil = report_page([read_recorded(EVIL, evil_bag(tmp_path / "evil"))])
    visit = opened(evil, before="window.broken = () => { window.ran = true; };")
    page = visit.page
    assert page.evaluate("window.ran") is None
    assert visit.errors == [] and visit.requests == []
    assert page.locator("h1").inner_text() == EVIL
    assert page.locator("img").count() == 0
    assert page.title().startswith(EVIL)
    for button in page.locator(".ranges button").all()[:2]:
        button.click()
    settle(page)
    shown = page.locator(".infolayer .annotation-text").all_text_contents()
    assert any(EVIL in text for text in shown)  # a phase is named as it is


def test_even_a_script_that_got_in_would_not_run(opened: Open, html: str) -> None:
    """The policy of the page is a second wall behind the escaping."""
    visit = opened(
        html.replace("</main>", "<script>window.ran = 1</script><b onclick='ran = 2'>x</b></main>")
    )
    visit.page.locator("b").click()
    assert visit.page.evaluate("window.ran") is None
    assert len([error for error in visit.errors if "Content Security Policy" in error]) == 2


def test_a_plot_of_many_lines_tells_the_nearest_one_and_its_time(opened: Open) -> None:
    page = opened().page
    box = frame_of(page, "arm_a/joint_torque")
    page.mouse.move(box["x"] + 250, box["middle"])
    label = "plots.plots[4].frame.querySelector('.hoverlayer .hovertext')"
    until(page, label)
    told = page.evaluate(f"{label}.textContent")
    assert re.fullmatch(r"joint \d, (nmpc|pid).+ N m at 0\.\d\d\d s", told), told


def test_a_plot_can_be_saved(opened: Open) -> None:
    """The policy of the page must not keep a plot from becoming a file."""
    visit = opened()
    frame_of(visit.page, "arm_b/position_error")
    plot = visit.page.locator("[data-plot='arm_b/position_error']")
    plot.locator(".frame").hover()
    with visit.page.expect_download() as saved:
        plot.locator("[data-title^='Download']").click()
    assert saved.value.suggested_filename == "arm_b_position_error.svg"
    assert saved.value.path().read_text(encoding="utf-8").startswith("<svg")
    assert visit.errors == []


def test_it_prints_whole(opened: Open) -> None:
    page = opened().page
    assert page.locator("details:not([open])").count() > 0
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert page.locator("details:not([open])").count() == 0
    assert page.pdf()[:4] == b"%PDF"


def test_without_scripts_the_tables_are_there(browsing: Browsing, html: str, tmp_path: Path) -> None:
    file = tmp_path / "report.html"
    file.write_text(html, encoding="utf-8")
    context = browsing.browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(file.as_uri())
    assert page.locator("noscript").is_visible()
    assert page.locator("#summary td.better").count() > 0
    context.close()
