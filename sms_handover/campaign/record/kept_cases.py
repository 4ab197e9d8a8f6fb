"""Kept cases: the worst ones of a campaign, each run again once all have a row, with all that it gives."""

import shutil
import tempfile
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path

from sms_handover.campaign.cases.case import Cases
from sms_handover.campaign.cases.case_row import Row, Task
from sms_handover.campaign.cases.retained import worst_path
from sms_handover.campaign.definition.fields import BAG
from sms_handover.campaign.record.campaign_folder import CampaignFolder
from sms_handover.campaign.record.durable_file import (
    make_folder,
    sync_folder,
    unfinished_name,
    unwritable,
    write_durably,
)
from sms_handover.campaign.record.output import Output
from sms_handover.campaign.statistics.worst_cases import rerun_command, worst_of
from sms_handover.errors import SmsHandoverError
from sms_handover.simulation.save import write_arrays

Record = Callable[[CampaignFolder, Task, Path], None]
"""Runs a case as a graph and records it to a new folder; raises SmsHandoverError unless equal to its row."""


def keep_worst(folder: CampaignFolder, record: Record | None) -> Iterator[Output]:
    """Keep the worst cases that are not kept yet; yield a line on each, also on one that cannot be kept.

    What is interrupted leaves nothing that is taken for whole. ``record`` is None where there is no ROS.
    """
    keep, metric = folder.campaign.keep, folder.campaign.worst_by
    if not keep.worst:
        return
    if folder.manifest.shard.of > 1:
        yield Output("the worst cases are known once all shards are merged: 'campaign merge' keeps them")
        return
    chosen = worst_of(folder.entries(), metric, keep.worst)
    every = [row for rows in chosen.values() for row in rows]
    missing = [row for row in every if not worst_path(folder.path, keep, row.task).exists()]
    if not missing:
        return
    if keep.worst_as == BAG and record is None:
        yield Output(
            f"{len(missing)} worst cases have no bag: ROS is not installed here (extra 'ros'); where it is, "
            "the same command records them",
            is_lacking=True,
        )
        return
    yield Output(f"{len(missing)} worst cases by {metric} are run again, to be kept as {keep.worst_as}")
    with tempfile.TemporaryDirectory(prefix="sms_handover_worst_") as scratch:
        cases = Cases(folder.frozen, folder.manifest.cases, Path(scratch))
        for number, row in enumerate(missing, start=1):
            place = f"({number} of {len(missing)})"
            try:
                path = _keep(folder, cases, row, record if keep.worst_as == BAG else None)
                yield Output(f"{path}: equal to its row, bit for bit {place}")
            except SmsHandoverError as error:
                one_scenario = len(folder.campaign.scenarios) == 1
                command = rerun_command(str(folder.path), row.task, one_scenario=one_scenario)
                yield Output(f"{row.task} is not kept: {error} {place}; {command}", is_lacking=True)


def _keep(folder: CampaignFolder, cases: Cases, row: Row, record: Record | None) -> Path:
    """Keep a case, recorded if that is given; return where. Raises SmsHandoverError."""
    path = worst_path(folder.path, folder.campaign.keep, row.task)
    if record is None:
        write_durably({path: _arrays(cases, row)})
        return path
    unfinished = unfinished_name(path)
    try:
        make_folder(path.parent)
        _remove(unfinished)  # of a session that was killed
        try:
            record(folder, row.task, unfinished)
            unfinished.replace(path)
            sync_folder(path.parent)
        finally:
            _remove(unfinished)
    except OSError as error:
        raise unwritable(path, error) from error
    return path


def _arrays(cases: Cases, row: Row) -> memoryview:
    """Run a case here and return its arrays; raises SmsHandoverError if it differs from its row."""
    result = cases.run(row.task)
    if result.run is None or result.row.text != row.text:
        raise SmsHandoverError(
            "run again it differs from its row, as it may on another class of processors or other libraries"
        )
    stream = BytesIO()
    write_arrays(result.run, stream)
    return stream.getbuffer()


def _remove(path: Path) -> None:
    """Remove a file or a folder that may be there."""
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
