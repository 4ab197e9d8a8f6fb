"""The page of a report, read as text: what it says, that nothing of a bag becomes markup, and the command."""

import json
from collections.abc import Mapping
from dataclasses import replace
from html.parser import HTMLParser
from importlib import import_module as really_import
from pathlib import Path
from shutil import copytree
from types import ModuleType

import pytest

from sms_handover.analysis.comparison import compare
from sms_handover.analysis.highlights import highlights
from sms_handover.bag.recording import Recording
from sms_handover.cli.main import main
from sms_handover.report import engine
from sms_handover.report.page import report_page
from sms_handover.report.recorded_run import RecordedRun, compare_recorded, read_recorded
from sms_handover.run_data import RunData
from sms_handover.types import GraspAction, GraspCommand, GraspEvent, GraspStatus, TaskPhase

from .bag_messages import (
    JOINT_STATE,
    TYPES,
    WALL_NS,
    joint_state,
    made_up_run,
    odometry,
    open_topics,
    record_run,
)
from .report_bags import Parameters, parameters, write_bag
from .test_analysis_runs import changed

EVIL = "</script><script>broken()</script><img src=x onerror=broken()>\"'&amp;{{ 7 * 7 }}<b>"
VOID = {"meta", "link", "input", "img", "br", "line"}


class Page(HTMLParser):
    """The elements of a page: tags with their attributes, and the text in each kind of element."""

    def __init__(self, html: str) -> None:
        """Read the page."""
        super().__init__(convert_charrefs=True)
        self.tags: list[tuple[str, dict[str, str]]] = []
        self.texts: dict[str, list[str]] = {}
        self._open: list[str] = []
        self.feed(html)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note an element."""
        self.tags.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in VOID:
            self._open.append(tag)
            self.texts.setdefault(tag, []).append("")

    def handle_endtag(self, tag: str) -> None:
        """Leave an element; every one must be closed in its turn."""
        assert not self._open or tag in VOID or self._open.pop() == tag, f"</{tag}> at {self.getpos()}"

    def handle_data(self, data: str) -> None:
        """Add text to all open elements."""
        for tag in set(self._open):
            self.texts[tag][-1] += data

    @property
    def open(self) -> list[str]:
        """Return what was never closed."""
        return self._open

    def attributes(self, tag: str) -> list[dict[str, str]]:
        """Return the attributes of every element of a kind."""
        return [attributes for name, attributes in self.tags if name == tag]


@pytest.fixture(scope="module")
def runs(handover_bags: dict[str, Path]) -> tuple[RecordedRun, ...]:
    return tuple(read_recorded(law, bag) for law, bag in handover_bags.items())


@pytest.fixture(scope="module")
def html(runs: tuple[RecordedRun, ...]) -> str:
    return report_page(runs)


def data_in(page: Page) -> Mapping[str, object]:
    """Return what the scripts of a page are given."""
    places = [attributes.get("id") for attributes in page.attributes("script")]
    found = json.loads(page.texts["script"][places.index("report-data")])
    assert isinstance(found, dict)
    return found


def test_every_figure_of_the_summary_is_on_the_page(html: str, runs: tuple[RecordedRun, ...]) -> None:
    page = Page(html)
    assert page.open == []
    assert page.texts["h1"] == ["nmpc and pid, side by side"]
    cells = page.texts["td"]
    for item in highlights(compare({run.name: run.data for run in runs})).rows:
        for place, cell in enumerate(item.cells):
            assert (cell + " (better)" if place in item.better else cell) in cells
    marked = [attributes for attributes in page.attributes("td") if attributes.get("class") == "better"]
    assert len(marked) > len(runs)


def test_every_claim_has_its_verdict(html: str, runs: tuple[RecordedRun, ...]) -> None:
    page = Page(html)
    claims = compare({run.name: run.data for run in runs}).claims
    badges = [text for text in page.texts["span"] if text in {"holds", "does not hold"}]
    assert badges == ["holds" if claim.holds else "does not hold" for claim in claims]
    assert page.texts["blockquote"] == [claim.paper for claim in claims]


def test_it_refers_to_nothing_outside(html: str) -> None:
    page = Page(html)
    for tag, attributes in page.tags:
        for name in ("src", "href", "action", "data", "poster"):
            assert attributes.get(name, "#").startswith(("#", "data:,")), (tag, attributes)
    (policy,) = [a["content"] for a in page.attributes("meta") if "http-equiv" in a]
    assert policy.startswith("default-src 'none'")


def test_the_animation_stands_in_a_closed_frame(html: str) -> None:
    (frame,) = Page(html).attributes("iframe")
    assert frame["sandbox"] == "allow-scripts"
    assert frame["srcdoc"].startswith("<!DOCTYPE html>")


@pytest.mark.parametrize("count", [1, 3])
def test_there_may_be_one_run_or_several(runs: tuple[RecordedRun, ...], count: int) -> None:
    several = [replace(runs[0], name=f"run {number}") for number in range(count)]
    page = Page(report_page(several))
    assert page.open == []
    assert "Claims of the paper" not in page.texts["h2"]
    heads = [row for row in page.texts["tr"] if row.startswith("Worst value of the run")]
    assert heads[0].split()[5:] == [word for run in several for word in run.name.split()]


def test_a_law_of_another_package_stands_beside_ours(runs: tuple[RecordedRun, ...], tmp_path: Path) -> None:
    """Three laws: a card, a column and lines for each by its name, and still the claims about our two."""
    urdf, schedule = runs[0].info.urdf_text, runs[0].info.schedule_text
    values = parameters("task_space_pd")
    bag = write_bag(tmp_path / "own", runs[0].data, urdf=urdf, schedule=schedule, values=values)
    page = Page(report_page([read_recorded("own", bag), *runs]))
    assert page.texts["h1"] == ["own, nmpc and pid, side by side"]
    laws = [text.split()[1] for text in page.texts["p"] if text.startswith("law ")]
    assert laws == ["task_space_pd", "nmpc", "pid"]
    heads = [row.split() for row in page.texts["tr"] if row.split()[:1] == ["Task"]]
    assert heads == [["Task", "own", "nmpc", "pid"]]
    assert len(page.texts["blockquote"]) == 6
    plots = data_in(page)["plots"]
    assert isinstance(plots, list)
    drawn = {plot["key"]: {line["run"] for line in plot["lines"]} for plot in plots}
    assert drawn["clearance"] == drawn["arm_a/position_error"] == {0, 1, 2}


def test_the_card_of_a_run_says_whether_its_task_was_done(html: str, runs: tuple[RecordedRun, ...]) -> None:
    comparison = compare_recorded(runs)
    cards = [text for text in Page(html).texts["li"] if text.startswith("task ")]
    for run, card in zip(runs, cards, strict=True):
        found = comparison.runs[run.name].completion
        assert card.startswith(
            "task complete" if found.complete else f"task not complete: {found.shortfalls[0]}"
        )


def evil_run() -> RunData:
    """Return a run in which every text that a bag carries is hostile."""
    run = made_up_run(ticks=41)
    command = GraspCommand(GraspAction.GRASP, "arm_a", EVIL)
    return changed(
        run,
        phases=tuple(TaskPhase(phase.stamp_ns, phase.index, EVIL + phase.name) for phase in run.phases),
        grasp_events=(GraspEvent(0, command, GraspStatus.SUCCEEDED, 1e-3, 2e-3, 3e-3, EVIL),),
    )


def evil_bag(folder: Path) -> Path:
    """Write a bag of a hostile run, with hostile parameters, schedule, description and provenance."""
    values: Parameters = {EVIL: {EVIL: EVIL, "list": [EVIL]}, "controller": {"law": EVIL, EVIL: EVIL}}
    return write_bag(
        folder, evil_run(), urdf=EVIL, schedule=EVIL, values=values, origin={"start": EVIL, EVIL: EVIL}
    )


def test_no_text_of_a_bag_becomes_markup(tmp_path: Path, runs: tuple[RecordedRun, ...]) -> None:
    """The page has the same elements as one of a bag with harmless texts, so nothing was added to it."""
    evil = read_recorded(EVIL, evil_bag(tmp_path / "evil"))
    page = Page(report_page([evil]))
    assert page.open == []
    known = {tag for tag, _ in Page(report_page(runs[:1])).tags}
    assert {tag for tag, _ in page.tags} <= known | {"pre"}
    assert len(page.attributes("script")) == 3  # plotly, ours, and the data
    assert not any(name.startswith("on") for _, attributes in page.tags for name in attributes)
    assert page.texts["h1"] == [EVIL]  # shown as it is
    data = data_in(page)
    assert EVIL in str(data["phases"]) or repr(EVIL)[1:-1] in str(data["phases"])
    assert EVIL in page.texts["pre"]


def test_missing_topics_and_files_leave_gaps_not_errors(tmp_path: Path) -> None:
    """A bag with states and odometry alone still gets its report."""
    with Recording(tmp_path / "bag", types=TYPES) as recording:
        recording.add_topic("/joint_states", JOINT_STATE)
        recording.add_topic("/base_odometry", "nav_msgs/msg/Odometry")
        run = made_up_run(ticks=30)
        for k, stamp in enumerate(run.tick_ns):
            state = joint_state(int(stamp), run.joint_names, run.joint_position[k])
            recording.receive("/joint_states", TYPES.serialize(state), WALL_NS)
            pose = odometry(int(stamp), run.base_pose[k], run.base_twist[k])
            recording.receive("/base_odometry", TYPES.serialize(pose), WALL_NS)
    page = Page(report_page([read_recorded("bare", tmp_path / "bag")]))
    assert page.open == []
    assert "not recorded" in page.texts["p"]
    assert "bare is not shown: its bag carries no robot description" in page.texts["p"]


def test_the_command_writes_a_page_once(
    handover_bags: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["report", *map(str, handover_bags.values()), "-o", str(tmp_path / "out")]
    assert main(arguments) == 0
    assert "index.html: " in capsys.readouterr().out
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["index.html"]
    assert main(arguments) == 2
    assert "exists; choose another place, or --overwrite it" in capsys.readouterr().err
    assert main([*arguments, "--overwrite"]) == 0
    assert main([*arguments[:3], "-o", str(tmp_path / "alone.html")]) == 0
    assert (tmp_path / "alone.html").is_file()


@pytest.mark.parametrize("kind", ["absent", "other", "text", "cut", "parameters", "twice", "place"])
def test_wrong_input_is_one_line_and_exit_code_2(
    kind: str, handover_bags: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    good = handover_bags["pid"]
    other = tmp_path / "other"
    with Recording(other, types=TYPES) as recording:
        recording.add_topic("/camera/joint_states", JOINT_STATE)
        recording.receive("/camera/joint_states", TYPES.serialize(joint_state(1)), WALL_NS)
    with Recording(tmp_path / "parameters", types=TYPES) as recording:
        recording.writer.attach("parameters.json", "application/json", b"no JSON")
        open_topics(recording)
        record_run(recording, made_up_run(ticks=3))
    (tmp_path / "notes.txt").write_text("no bag", encoding="utf-8")
    (tmp_path / "cut.mcap").write_bytes(next(good.glob("*.mcap")).read_bytes()[:50_000])
    (tmp_path / "file").write_text("", encoding="utf-8")
    cases: dict[str, tuple[list[Path], str, str]] = {
        "absent": ([tmp_path / "nowhere"], "out", "there is no bag at"),
        "other": ([other], "out", "holds no run of sms_handover"),
        "text": ([tmp_path / "notes.txt"], "out", "is not an MCAP file"),
        "cut": ([good, tmp_path / "cut.mcap"], "out", "cut.mcap"),
        "parameters": ([tmp_path / "parameters"], "out", "parameters.json in the bag is not JSON"),
        "twice": ([good, good], "out", "two runs are named 'pid'"),
        "place": ([good], "file/report", "cannot be written"),
    }
    bags, output, message = cases[kind]
    assert main(["report", *map(str, bags), "-o", str(tmp_path / output)]) == 2
    errors = capsys.readouterr().err.splitlines()
    assert message in errors[-1] and errors[-1].startswith("sms-handover report: error: ")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("package", ["jinja2", "plotly"])
def test_a_missing_package_is_named_with_its_remedy(
    package: str,
    handover_bags: dict[str, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def without(name: str) -> ModuleType:
        if name.partition(".")[0] == package:
            raise ModuleNotFoundError(name)
        return really_import(name)

    monkeypatch.setattr(engine, "import_module", without)
    assert main(["report", str(handover_bags["pid"]), "-o", str(tmp_path / "out")]) == 1
    assert (
        f"need {package}, which is not installed: pip install 'sms_handover[analysis]'"
        in capsys.readouterr().err
    )
    assert not (tmp_path / "out").exists()


def test_a_bag_in_an_output_folder_has_the_name_of_the_folder(
    handover_bags: dict[str, Path], tmp_path: Path
) -> None:
    for law, bag in handover_bags.items():
        copytree(bag, tmp_path / law / "bag")
    for tail in ("", "bag"):
        out = tmp_path / f"of_{tail}.html"
        assert main(["report", *(str(tmp_path / law / tail) for law in handover_bags), "-o", str(out)]) == 0
        assert Page(out.read_text(encoding="utf-8")).texts["h1"] == ["nmpc and pid, side by side"]
