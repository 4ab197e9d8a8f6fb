"""``sms-handover report``: recorded runs as one HTML page, or as figures for print."""

from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from sms_handover.campaign.page.campaign_page import campaign_page
from sms_handover.campaign.record.campaign_folder import CampaignFolder
from sms_handover.cli.figure_files import LISTED, add_figure_options, draw, figures_of
from sms_handover.cli.recorded_runs import campaign_among, read_all
from sms_handover.cli.text_files import write_text
from sms_handover.engines.registry import ENGINES, load_engine
from sms_handover.errors import ConfigurationError
from sms_handover.launcher.recorded_engine import recorded_verdict
from sms_handover.report.page import report_page
from sms_handover.report.recorded_run import RecordedRun
from sms_handover.terminal.progress import Progress

_PAGE = "index.html"
_FOLDER = Path("report")
_BYTES_PER_MB = 1e6


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.description = (
        "Write one HTML page on recorded runs: the figures side by side, plots to zoom into, the\n"
        "paper's claims with verdicts (of one run under nmpc and one under pid), what the bags were\n"
        "made with and where they differ, and the handover in 3D.\n\n"
        "The page is a single file that needs no network: open it in any browser, send it by mail.\n"
        "With --figures draw the paper's figures instead, or beside it if --output is given too."
    )
    parser.epilog = (
        "examples:\n"
        "  sms-handover report runs/nmpc runs/pid            writes report/index.html\n"
        "  sms-handover report runs/mine -o mine.html        one run, into a file of that name\n"
        "  sms-handover report runs/mine --with mujoco       with what another engine says of it\n"
        "  sms-handover report runs/nmpc --figures figures   figures for print, no page\n\n"
        f"figures (docs/figures.md):\n{LISTED}\n\n"
        "exit codes: 0 the page or the figures are written; 1 a package is missing; 2 wrong input, as a\n"
        "bag that is not ours or a page that exists already, and nothing was written"
    )
    parser.add_argument(
        "runs",
        nargs="+",
        type=Path,
        metavar="RUN",
        help="output folder of a run, or a bag; or the folder of one campaign",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="PATH",
        help=f"folder for {_PAGE}, or a file that ends in .html (default: {_FOLDER})",
    )
    parser.add_argument("--overwrite", action="store_true", help="replace the page if it exists")
    parser.add_argument(
        "--with",
        dest="engine",
        choices=tuple(ENGINES),
        help="let another engine replay the runs, as verify does, and show what came of it",
    )
    add_figure_options(parser)


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    figures = figures_of(options)
    page = _page(options.output or _FOLDER) if options.output or not figures else None
    if page and page.exists() and not options.overwrite:
        raise ConfigurationError(f"{page} exists; choose another place, or --overwrite it")
    campaign = campaign_among(options.runs)
    if campaign and (figures or options.engine):
        raise ConfigurationError(f"{campaign.path} is a campaign: figures and second engines are for runs")
    engine = load_engine(options.engine) if options.engine and page else None
    with Progress() as progress:
        runs = () if campaign else read_all(options.runs, progress)
        if engine:
            progress.show(f"replaying in {engine.title}")
            said = [recorded_verdict(engine, run.info.path) for run in runs]
            runs = tuple(replace(run, second_engine=verdict) for run, verdict in zip(runs, said, strict=True))
        progress.show("drawing")
        content = _content(runs, campaign, page.parent) if page else ""
    if page:
        write_text(page, content, parents=True)
        print(f"{page}: {len(content.encode()) / _BYTES_PER_MB:.1f} MB; open it in a browser")
    if figures:
        draw(runs, figures)
    return 0


def _content(runs: Sequence[RecordedRun], campaign: CampaignFolder | None, place: Path) -> str:
    """Return the page of runs, or of a campaign with links from a page in ``place``."""
    return campaign_page(campaign, place) if campaign else report_page(runs)


def _page(place: Path) -> Path:
    """Return the file of the page."""
    return place if place.suffix == ".html" else place / _PAGE
