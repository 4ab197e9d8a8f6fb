"""Page of a campaign: one HTML document that needs no network, as that of runs is."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from os.path import relpath
from pathlib import Path
from urllib.parse import quote

from sms_handover import __version__
from sms_handover.campaign.cases.case import in_words, inputs_in_words
from sms_handover.campaign.cases.case_metrics import USUAL
from sms_handover.campaign.cases.case_row import Row
from sms_handover.campaign.cases.retained import worst_path
from sms_handover.campaign.definition.campaign_file import Campaign
from sms_handover.campaign.page.campaign_plots import campaign_plots
from sms_handover.campaign.record.campaign_folder import CampaignFolder
from sms_handover.campaign.statistics.case_columns import Group, columns_of
from sms_handover.campaign.statistics.extent import extent_of
from sms_handover.campaign.statistics.notes import PERCENTILES, note_on_sampler, note_on_stop, note_on_tests
from sms_handover.campaign.statistics.paired_tests import paired_tests
from sms_handover.campaign.statistics.sensitivity import FEWEST
from sms_handover.campaign.statistics.tables import (
    TEST_HEAD,
    TESTED,
    outcome_sections,
    paired_section,
    sensitivity_sections,
)
from sms_handover.campaign.statistics.worst_cases import failures_by_cause, for_shell, rerun_command, worst_of
from sms_handover.report.engine import plotly_script, render, web_file
from sms_handover.report.security import content_security_policy
from sms_handover.report.styles import RunStyle, run_styles

PAGE = "index.html"
_WORST = 5  # [-] cases of each law
_MOST_CAUSES = 20  # [-]
_SCRIPTS = ("data.js", "colours.js", "campaign.js")


@dataclass(frozen=True)
class Headed:
    """What the head of a column of a table shows of a law."""

    style: RunStyle


@dataclass(frozen=True)
class CaseLine:
    """A case in a list: what came of it, its draws, and the command that runs it again.

    ``link`` leads from the page to ``kept``, the path of its whole run; both are '' where it is not kept.
    """

    text: str
    inputs: str
    command: str
    link: str = ""
    kept: str = ""


def campaign_page(folder: CampaignFolder, place: Path | None = None) -> str:
    """Return the page of a campaign folder, with links for a page in ``place``, by default that folder.

    Raises MissingDependencyError without what it needs.
    """
    campaign, entries = folder.campaign, list(folder.entries())
    columns = columns_of(entries)
    plots = campaign_plots(campaign, columns)
    scripts = (plotly_script(), "\n".join(web_file(name) for name in _SCRIPTS))
    causes = failures_by_cause(entries).most_common()
    tests, extent = paired_tests(columns, TESTED), extent_of(folder, entries)
    paired = paired_section(tests)
    return render(
        "campaign.html.j2",
        version=__version__,
        policy=content_security_policy(scripts),
        style=web_file("report.css"),
        scripts=scripts,
        name=campaign.name,
        description=campaign.description,
        success=campaign.success.text,
        extent=extent,
        stop_note=note_on_stop(campaign.stop, extent.stopped_at),
        runs=[Headed(style) for style in run_styles(campaign.laws, campaign.laws)],
        sections=outcome_sections(campaign, columns),
        interval_notes=[note for note in (PERCENTILES, note_on_sampler(campaign.sampler.kind)) if note],
        tests_note=note_on_tests(tests),
        causes=[(*cause, times) for cause, times in causes[:_MOST_CAUSES]],
        further=_further(causes[_MOST_CAUSES:], folder),
        worst=[*_worst(folder, worst_of(entries, campaign.worst_by, _count(campaign)), place or folder.path)],
        worst_by=campaign.worst_by,
        fewest=FEWEST,
        tables=[*([(TEST_HEAD, paired)] if paired else []), *sensitivity_sections(campaign, columns)],
        plots=plots,
        data={"plots": [plot.data for plot in plots]},
        draws=_draws(folder),
        files=folder.frozen.files,
        manifest=folder.manifest,
        metrics=USUAL,
    )


def _further(causes: Sequence[tuple[object, int]], folder: CampaignFolder) -> str:
    """Return how many causes are not listed, of how many cases, and where they are; '' if all are listed."""
    if not causes:
        return ""
    command = f"sms-handover campaign status {for_shell(str(folder.path))} --failed"
    return f"{len(causes)} more causes, of {sum(times for _, times in causes)} runs: {command}"


def _count(campaign: Campaign) -> int:
    """Return how many of the worst cases of each law are listed: those that are kept at least."""
    return max(_WORST, campaign.keep.worst)


def _worst(folder: CampaignFolder, found: dict[Group, list[Row]], place: Path) -> Iterator[CaseLine]:
    """Yield the worst cases of each law; links lead from a page in ``place``."""
    path, metric = folder.path, folder.campaign.worst_by
    one_scenario = len(folder.campaign.scenarios) == 1
    for rows in found.values():
        for row in rows:
            kept = worst_path(path, folder.campaign.keep, row.task)
            yield CaseLine(
                in_words(row, metric),
                inputs_in_words(row.inputs),
                rerun_command(str(path), row.task, one_scenario=one_scenario),
                *((quote(relpath(kept, place)), str(kept)) if kept.exists() else ()),
            )


def _draws(folder: CampaignFolder) -> list[tuple[str, str]]:
    """Return each drawn value with its distribution in words."""
    campaign = folder.campaign
    grouped = [
        (path, f"{one}, correlated") for group in campaign.groups for path, one in group.normals.items()
    ]
    listed = [(path, "from a table") for path in campaign.sampler.rows[0]] if campaign.sampler.rows else []
    return [*((path, str(one)) for path, one in campaign.draws.items()), *grouped, *listed]
