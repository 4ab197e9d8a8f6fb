"""Figures as files: every format whole, fonts embedded, and the same bytes each time."""

import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import matplotlib
import pytest
from PIL import Image

from sms_handover.analysis.figure_catalogue import FORMATS, chosen_formats
from sms_handover.analysis.figures.draw import draw_figures, write_figure
from sms_handover.analysis.figures.style import COLUMN
from sms_handover.errors import ConfigurationError, UnknownNameError

from .bag_messages import made_up_run
from .figure_runs import named

# draws in a process of its own, as a user does on another day
SCRIPT = """
import sys
from pathlib import Path
from bag_messages import made_up_run
from sms_handover.analysis.figures.draw import draw_figures, write_figure
from sms_handover.analysis.figures.drawn_run import DrawnRun
runs = [DrawnRun("run_1", made_up_run()), DrawnRun("run_2", made_up_run(seed=1))]
for name, figure in draw_figures(runs, sys.argv[2:]):
    for suffix in ("pdf", "png", "svg"):
        write_figure(figure, Path(sys.argv[1]) / f"{name}.{suffix}", 60)
"""
HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
TWICE = ("momentum", "base_path")  # a plain figure and the one in perspective are enough to draw again


def written(folder: Path, names: tuple[str, ...] = (), dpi: int = 60) -> dict[str, bytes]:
    """Write the figures of two made-up runs in every format; return the content of each file."""
    folder.mkdir()
    for name, figure in draw_figures(named([made_up_run(), made_up_run(seed=1)]), names):
        for suffix in FORMATS:
            write_figure(figure, folder / f"{name}.{suffix}", dpi)
    return contents(folder)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    return written(tmp_path_factory.mktemp("figures") / "first")


def test_every_figure_is_written_in_every_format(files: dict[str, bytes], tmp_path: Path) -> None:
    assert len(files) == 9 * len(FORMATS)
    for name, data in files.items():
        if name.endswith(".svg"):
            root = ElementTree.fromstring(data)
            assert root.tag == "{http://www.w3.org/2000/svg}svg"
            assert len(root.findall(".//{http://www.w3.org/2000/svg}path")) > 10
        elif name.endswith(".pdf"):
            assert data.startswith(b"%PDF-") and data.rstrip().endswith(b"%%EOF")
        else:
            (tmp_path / name).write_bytes(data)
            with Image.open(tmp_path / name) as image:
                image.verify()


def test_fonts_are_embedded_as_truetype(files: dict[str, bytes]) -> None:
    """Type 3 is what many publishers refuse; an SVG has its letters as outlines."""
    for name, data in files.items():
        if name.endswith(".pdf"):
            assert b"/FontFile2" in data
            assert b"/Type3" not in data
        elif name.endswith(".svg"):
            assert b"<text" not in data


def test_a_png_has_the_dots_asked_for(tmp_path: Path) -> None:
    written(tmp_path / "fine", ("momentum",), dpi=200)
    with Image.open(tmp_path / "fine" / "momentum.png") as image:
        assert image.width == pytest.approx(COLUMN * 200, abs=1)


def test_the_same_runs_give_the_same_bytes(files: dict[str, bytes], tmp_path: Path) -> None:
    again = written(tmp_path / "again", TWICE)
    assert len(again) == len(TWICE) * len(FORMATS)
    assert [name for name in again if files[name] != again[name]] == []


def test_another_process_with_other_settings_gives_the_same_bytes(
    files: dict[str, bytes], tmp_path: Path
) -> None:
    """Neither the order of hashes, nor the day, nor the user's own matplotlib style may be seen."""
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    settings = tmp_path / "matplotlibrc"
    settings.write_text(
        "axes.facecolor: red\nxtick.top: True\nsavefig.bbox: tight\nlines.linewidth: 9\n", encoding="utf-8"
    )
    environment = {
        **os.environ,
        "PYTHONHASHSEED": "7",
        "MATPLOTLIBRC": str(settings),
        "SOURCE_DATE_EPOCH": "1000000000",
        "PYTHONPATH": f"{ROOT}{os.pathsep}{HERE}",
    }
    subprocess.run([sys.executable, "-c", SCRIPT, str(folder), *TWICE], env=environment, cwd=ROOT, check=True)
    elsewhere = contents(folder)
    assert len(elsewhere) == len(TWICE) * len(FORMATS)
    assert [name for name in elsewhere if files[name] != elsewhere[name]] == []


def test_the_users_own_settings_stay_as_they_were() -> None:
    before = dict(matplotlib.rcParams)
    for _, _ in draw_figures(named([made_up_run()])):
        assert dict(matplotlib.rcParams) == before


def test_no_state_of_pyplot_is_touched() -> None:
    """Whoever draws in a notebook finds none of these figures among the open ones."""
    code = "import sys, sms_handover.analysis.figures.draw\nassert 'matplotlib.pyplot' not in sys.modules"
    subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}, check=True
    )


def test_without_matplotlib_one_line_says_what_to_install() -> None:
    code = "import sys\nsys.modules['matplotlib'] = None\nimport sms_handover.analysis.figures.draw"
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    ended = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    assert ended.returncode != 0
    assert (
        "figures need matplotlib, which is not installed: pip install 'sms_handover[analysis]'"
        in ended.stderr
    )


def test_formats_are_checked(tmp_path: Path) -> None:
    assert chosen_formats(["svg", "png", "svg"]) == ("svg", "png")
    with pytest.raises(UnknownNameError, match="unknown figure format 'pgn' \\(did you mean 'png'\\?\\)"):
        chosen_formats(["pgn"])
    (_, figure), *_ = draw_figures(named([made_up_run()]), ["momentum"])
    with pytest.raises(UnknownNameError, match="unknown figure format 'jpg'"):
        write_figure(figure, tmp_path / "momentum.jpg")


def test_a_file_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    (_, figure), *_ = draw_figures(named([made_up_run()]), ["momentum"])
    with pytest.raises(ConfigurationError, match=r"missing/momentum\.png cannot be written: No such file"):
        write_figure(figure, tmp_path / "missing" / "momentum.png")
