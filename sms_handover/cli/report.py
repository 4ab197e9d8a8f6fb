"""``sms-handover report``: recorded runs as one HTML page."""

from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from pathlib import Path

from sms_handover.cli.recorded_runs import read_all
from sms_handover.cli.text_files import write_text
from sms_handover.errors import ConfigurationError
from sms_handover.report.page import report_page
from sms_handover.terminal.progress import Progress

_PAGE = "index.html"
_BYTES_PER_MB = 1e6


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.description = (
        "Write one HTML page on recorded runs: the figures side by side, plots to zoom into, the\n"
        "paper's claims with verdicts (of one run under nmpc and one under pid), what the bags were\n"
        "made with and where they differ, and the handover in 3D.\n\n"
        "The page is a single file that needs no network: open it in any browser, send it by mail."
    )
    parser.epilog = (
        "examples:\n"
        "  sms-handover report runs/nmpc runs/pid            writes report/index.html\n"
        "  sms-handover report runs/mine -o mine.html        one run, into a file of that name\n\n"
        "exit codes: 0 the page is written; 1 a package is missing; 2 wrong input, as a bag that is\n"
        "not ours or a page that exists already, and nothing was written"
    )
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="output folder of a run, or a bag")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("report"),
        metavar="PATH",
        help=f"folder for {_PAGE}, or a file that ends in .html (default: report)",
    )
    parser.add_argument("--overwrite", action="store_true", help="replace the page if it exists")


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    page: Path = options.output if options.output.suffix == ".html" else options.output / _PAGE
    if page.exists() and not options.overwrite:
        raise ConfigurationError(f"{page} exists; choose another place, or --overwrite it")
    with Progress() as progress:
        runs = read_all(options.runs, progress)
        progress.show("drawing")
        content = report_page(runs)
    write_text(page, content, parents=True)
    print(f"{page}: {len(content.encode()) / _BYTES_PER_MB:.1f} MB; open it in a browser")
    return 0
