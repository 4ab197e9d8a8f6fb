"""Outputs of a campaign folder that are made of its journal: table, page, and the worst cases whole."""

from collections.abc import Iterator
from pathlib import Path

from sms_handover.campaign.page.campaign_page import PAGE, campaign_page
from sms_handover.campaign.record.campaign_folder import CampaignFolder
from sms_handover.campaign.record.cases_table import TABLE, write_table
from sms_handover.campaign.record.durable_file import write_durably
from sms_handover.campaign.record.kept_cases import Record, keep_worst
from sms_handover.campaign.record.output import Output
from sms_handover.errors import MissingDependencyError


def write_outputs(path: Path, record: Record | None) -> Iterator[Output]:
    """Write table, page and worst cases of a folder; yield a line on each, also on what could not be made.

    Table and page come first, as whoever waits for the worst cases may interrupt; then the page has links to
    those. ``record`` makes their bags, None where there is no ROS.
    """
    folder = CampaignFolder(path)
    try:
        rows = write_table(path / TABLE, folder.entries())
        yield Output(f"{path / TABLE}: {rows} rows")
    except MissingDependencyError as error:
        yield Output(f"{TABLE} is not written: {error}")
    is_written = False
    try:
        write_durably({path / PAGE: campaign_page(folder).encode()})
        is_written = True
        yield Output(f"{path / PAGE}: open it in a browser")
    except MissingDependencyError as error:
        yield Output(f"{PAGE} is not written: {error}")
    kept = list[Output]()
    for output in keep_worst(folder, record):
        kept.append(output)
        yield output
    if is_written and kept:
        write_durably({path / PAGE: campaign_page(folder).encode()})
