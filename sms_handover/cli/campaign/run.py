"""``sms-handover campaign run``: run a campaign, or go on with one."""

import sys
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Callable, Iterator
from errno import EDQUOT, ENOSPC
from pathlib import Path
from tempfile import TemporaryFile
from time import monotonic

from sms_handover.campaign.cases.first_cases import require_runnable
from sms_handover.campaign.definition.fields import BAG, MOST_CASES
from sms_handover.campaign.definition.frozen import campaign_path, freeze
from sms_handover.campaign.engine.choice import workers_for
from sms_handover.campaign.engine.run import Tally, run_campaign
from sms_handover.campaign.engine.scheduler_url import require_safe
from sms_handover.campaign.engine.workers import Workers
from sms_handover.campaign.record.campaign_folder import OpenCampaign, open_campaign
from sms_handover.campaign.record.manifest import MANIFEST, Shard, read_manifest, shard_of
from sms_handover.cli.campaign.outputs import has_ros, tell_outputs
from sms_handover.cli.exit_codes import EXIT_INTERRUPTED, EXIT_LOSS, EXIT_OK
from sms_handover.errors import ConfigurationError
from sms_handover.terminal.progress import Progress

_MOST_JOBS = 1024


def add_parser(parser: ArgumentParser) -> None:
    """Describe the command."""
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.description = (
        "Run all cases of a campaign that its folder lacks. Each finished case is on disk before it counts,\n"
        "so the same command goes on after Ctrl-C, a crash, or a full disk. Results depend neither on the\n"
        "number of workers nor on the order of cases. Then table and page are written, and the worst cases\n"
        "run again, as 'keep' in the file says."
    )
    parser.epilog = (
        "examples:\n"
        "  sms-handover campaign run laws -j 2\n"
        "  sms-handover campaign run laws -j 2 --cases 500    more cases; those that are there stay\n"
        "  sms-handover campaign run laws --shard 3/100       every 100th case, for a batch system\n\n"
        "exit codes: 0 every case has a row; 1 it could not go on; 2 wrong input; 3 every case has a row,\n"
        "but not every worst case could be kept; 130 interrupted"
    )
    parser.add_argument("file", metavar="FILE", help="campaign file, or the name of a shipped campaign")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FOLDER", help="folder of the campaign (default: runs/<name>)"
    )
    parser.add_argument(
        "--cases", type=int, metavar="N", help="number of cases in place of that in the file (random, sobol)"
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "-j",
        "--jobs",
        type=int,
        default=1,
        metavar="N",
        help="cases at the same time; more than 1 needs the extra 'campaign' (default: 1)",
    )
    where.add_argument(
        "--scheduler", default="", metavar="URL", help="take the workers of a Dask scheduler, tls://HOST:PORT"
    )
    parser.add_argument(
        "--trust-network",
        action="store_true",
        help="allow a scheduler over plain TCP on another machine: whoever reaches it can run code there",
    )
    parser.add_argument(
        "--shard", default="", metavar="I/N", help="run every N-th case only, the I-th part of N; see merge"
    )


def command(options: Namespace) -> int:
    """Run the command; return the exit code."""
    if not 1 <= options.jobs <= _MOST_JOBS:
        raise ConfigurationError(f"--jobs is {options.jobs}, must be from 1 to {_MOST_JOBS}")
    if options.cases is not None and not 1 <= options.cases <= MOST_CASES:
        raise ConfigurationError(f"--cases is {options.cases}, must be from 1 to {MOST_CASES}")
    if options.trust_network and not options.scheduler:
        raise ConfigurationError("--trust-network is for --scheduler")
    if options.scheduler:
        require_safe(options.scheduler, trust_network=options.trust_network)
    path = campaign_path(options.file)
    frozen, cases = freeze(path)
    cases = cases if options.cases is None else options.cases
    campaign, shard = frozen.campaign(cases), shard_of(options.shard) if options.shard else Shard()
    if options.shard and campaign.stop:
        raise ConfigurationError("a shard knows nothing of the others: leave stop out, or --shard")
    part = f".shard_{shard.number}_of_{shard.of}" if options.shard else ""
    folder = options.output or Path("runs") / f"{campaign.name}{part}"
    _require_writable(folder)
    known = read_manifest(folder).cases or 0 if (folder / MANIFEST).exists() else 0
    if options.cases is not None and options.cases < known:
        raise ConfigurationError(
            f"--cases is {options.cases}, must be >= {known}, which {folder} was made for: cases are only "
            "added; choose another folder with --output"
        )
    require_runnable(frozen, cases or known or None, path)
    with open_campaign(folder, frozen, cases, shard) as opened:
        try:
            with Progress() as progress:
                if known > (cases or known):
                    progress.print(f"{folder} has {known} cases, as was asked for before, not {cases}")
                progress.print(*_notices(opened))
                tally = run_campaign(opened, _maker(options, opened), _Shown(progress))
                progress.show(*_words(tally, ""), 1.0)
            if tally.stopped_at:
                print(f"stopped after {tally.stopped_at} cases: every interval is narrow enough")
            for group in tally.groups:
                share = tally.proportion(group)
                print(f"{group[0]} under {group[1]}: success {share} of {tally.rows[group]} cases")
            is_whole = tell_outputs(folder)
        except KeyboardInterrupt:
            print(f"interrupted: the same command goes on; what is there is in {folder}", file=sys.stderr)
            return EXIT_INTERRUPTED
    return EXIT_OK if is_whole else EXIT_LOSS


def _require_writable(folder: Path) -> None:
    """Raise ConfigurationError where no folder can be made, or written to, before any case is tried."""
    place = folder
    try:
        while not place.exists():
            place = place.parent
        if not place.is_dir():
            raise ConfigurationError(f"--output is {folder}, but {place} is no folder: choose another")
        with TemporaryFile(dir=place):  # which never has a name
            pass
    except OSError as error:
        if error.errno in (ENOSPC, EDQUOT):  # the same command goes on once there is room, and says so
            return
        raise ConfigurationError(
            f"--output is {folder}, but {place} cannot be written to: {error.strerror}; choose another"
        ) from error


def _notices(opened: OpenCampaign) -> Iterator[str]:
    """Yield what is to be known of a folder before it goes on."""
    yield from opened.faults
    for difference in opened.manifest.differences:
        yield f"sessions differ in {difference}: rows are equal bit for bit on equal ones only"
    keep = opened.campaign.keep
    if keep.worst_as == BAG and opened.manifest.shard.of == 1 and not has_ros():
        yield "keep.worst_as is bag, and ROS is not installed here: there will be no bags of the worst cases"


def _maker(options: Namespace, opened: OpenCampaign) -> Callable[[], Workers]:
    """Return what makes the workers that the options ask for."""
    frozen, cases = opened.frozen, opened.manifest.cases
    return lambda: workers_for(frozen, cases, jobs=options.jobs, scheduler=options.scheduler)


class _Shown:
    """Shows how far a campaign is, its rate, its successes so far and the time left."""

    def __init__(self, progress: Progress) -> None:
        self._progress, self._begin = progress, monotonic()

    def __call__(self, tally: Tally) -> None:
        if not self._progress.due:
            return
        rate = (tally.done - tally.before) / max(monotonic() - self._begin, 1e-9)
        left = (tally.total - tally.done) / max(rate, 1e-9)
        text, details = _words(tally, f"{rate:.3g}/s, {_duration(left)} left; ")
        self._progress.show(text, details, tally.done / max(tally.total, 1))


def _words(tally: Tally, pace: str) -> tuple[str, str]:
    """Return how far a campaign is as text, and its successes as details."""
    several = len({scenario for scenario, _ in tally.groups}) > 1
    successes = "; ".join(
        f"{f'{scenario} ' if several else ''}{law} {tally.proportion((scenario, law))}"
        for scenario, law in tally.groups
    )
    return f"{tally.done} of {tally.total}", f"{pace}{successes}"


def _duration(seconds: float) -> str:
    """Return a duration in hours, minutes and seconds."""
    minutes, second = divmod(round(seconds), 60)
    hours, minute = divmod(minutes, 60)
    return f"{hours}:{minute:02}:{second:02}" if hours else f"{minute}:{second:02}"
