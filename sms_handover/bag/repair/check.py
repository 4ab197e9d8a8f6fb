"""Check of a bag: whether it is complete, and what is missing."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from sms_handover.bag.files import BagFiles, Progress, damage_reported, files_of
from sms_handover.bag.mcap.damage import Damage
from sms_handover.bag.mcap.scan import FileScan, ScannedMessage, Source
from sms_handover.bag.metadata import counts_of, metadata_of
from sms_handover.bag.repair.check_content import ContentCheck
from sms_handover.bag.repair.check_index import IndexCheck
from sms_handover.bag.repair.findings import CheckResult, Findings
from sms_handover.bag.repair.message_counts import MessageCounts
from sms_handover.errors import BagError

_MOST = 20  # places of damage that are listed one by one


def check(path: Path, progress: Progress | None = None) -> CheckResult:
    """Return what is wrong with the bag at ``path``, its folder or a file.

    Checked are every checksum, index and summary against the file, ``metadata.yaml`` against both,
    the schema of every topic, stamps against the loss ledger, and of a recorded run whether it ended
    and every published message is there. Raises BagError if it is no MCAP bag at all.
    """
    bag = files_of(path)
    result = _Result(Findings(), ContentCheck(), MessageCounts(), Counter())
    findings, content = result.findings, result.content
    for scan in bag.scans(progress):
        with damage_reported(scan.file):
            _check_file(scan, result)
    if not content.any_record:
        raise BagError(f"{path} is not a bag: no record of an MCAP file is in it")
    _check_metadata(bag, result)
    content.close(findings, result.stated)
    result.stated.close(result.counts, findings)
    return CheckResult(path, bag.files, dict(result.counts), content.is_ours, findings.all)


@dataclass(frozen=True)
class _Result:
    """The results of all files of a bag."""

    findings: Findings
    content: ContentCheck
    stated: MessageCounts
    counts: Counter[str]


def _check_file(scan: FileScan, result: _Result) -> None:
    findings, content = result.findings, result.content
    if scan.size == 0:
        findings.damaged(f"{scan.file.name} is empty")
        return
    index = IndexCheck()
    damages: list[Damage] = []
    for found in scan:
        if isinstance(found, ScannedMessage):
            result.counts[found.source.topic] += 1
            index.message(found)
            content.message(found)
        elif isinstance(found, Source):
            result.counts[found.topic] += 0
            content.source(found)
        elif isinstance(found, Damage):
            damages.append(found)
        else:
            index.record(found, scan)
            content.record(found.record)
    for damage in damages[:_MOST]:
        findings.damaged(str(damage))
    if len(damages) > _MOST:
        findings.damaged(f"{scan.file.name}: {len(damages) - _MOST} more places of damage")
    if not scan.closed:
        findings.damaged(
            f"{scan.file.name} was not closed: the recorder was killed, the disk was full or the file was cut"
        )
    index.close(scan, findings, result.stated)


def _check_metadata(bag: BagFiles, result: _Result) -> None:
    """Compare ``metadata.yaml`` with the files."""
    findings = result.findings
    if not bag.path.is_dir():
        findings.note("metadata.yaml was not checked, as the bag was given as a file")
        return
    try:
        metadata = metadata_of(bag.path)
        counts = counts_of(metadata or {})
    except BagError as error:
        findings.damaged(str(error))
        return
    if metadata is None:
        findings.missing("metadata.yaml is not there: ros2 bag must scan the file for its topics")
        return
    listed = {Path(str(name)).name for name in metadata.get("relative_file_paths") or ()}
    there = {file.name for file in bag.files}
    for name in sorted(listed - there):
        findings.missing(f"{name} is not there, metadata.yaml lists it")
    for name in sorted(there - listed):
        findings.damaged(f"{name} is there, metadata.yaml does not list it")
    for name in sorted(set(bag.unlisted) - there):
        findings.note(f"{name} is not read, metadata.yaml does not list it")
    result.stated.add("metadata.yaml", {**dict.fromkeys(result.counts, 0), **counts})
    if metadata.get("message_count") != sum(counts.values()):
        findings.damaged("metadata.yaml contradicts itself about the number of messages")
