"""Outputs of a campaign folder that are made of its journal: table, full data of the worst cases, page."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

from sms_handover.campaign.cases.case import Cases
from sms_handover.campaign.cases.retained import FULL, file_of
from sms_handover.campaign.page.campaign_page import PAGE, campaign_page
from sms_handover.campaign.record.campaign_folder import CampaignFolder
from sms_handover.campaign.record.cases_table import TABLE, write_table
from sms_handover.campaign.statistics.worst_cases import worst_of
from sms_handover.errors import MissingDependencyError
from sms_handover.simulation.save import save_run


def write_outputs(path: Path) -> Iterator[str]:
    """Write table, data and page of a folder; yield a line on each, also on what could not be made."""
    folder = CampaignFolder(path)
    try:
        rows = write_table(path / TABLE, folder.entries())
        yield f"{path / TABLE}: {rows} rows"
    except MissingDependencyError as error:
        yield f"{TABLE} is not written: {error}"
    yield from _worst(folder)
    try:
        (path / PAGE).write_text(campaign_page(folder), encoding="utf-8")
        yield f"{path / PAGE}: open it in a browser"
    except MissingDependencyError as error:
        yield f"{PAGE} is not written: {error}"


def _worst(folder: CampaignFolder) -> Iterator[str]:
    """Run the worst cases of each law again and keep all of their data."""
    campaign = folder.campaign
    if not campaign.keep.worst:
        return
    chosen = worst_of(folder.entries(), campaign.worst_by, campaign.keep.worst)
    tasks = [row.task for rows in chosen.values() for row in rows]
    missing = [task for task in tasks if not file_of(folder.path, FULL, task).exists()]
    with tempfile.TemporaryDirectory(prefix="sms_handover_worst_") as scratch:
        cases = Cases(folder.frozen, folder.manifest.cases, Path(scratch))
        for task in missing:
            run = cases.run(task).run
            if run is not None:
                (folder.path / FULL).mkdir(exist_ok=True)
                save_run(run, file_of(folder.path, FULL, task))
    if missing:
        yield f"{folder.path / FULL}: all data of {len(missing)} worst cases"
