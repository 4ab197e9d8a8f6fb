"""The conformance suite of MCAP: every message of its 416 files comes out of every reader, or a reason."""

import json
import tarfile
from pathlib import Path
from typing import NamedTuple

from sms_handover.bag.files import read_messages
from sms_handover.bag.info import read_info
from sms_handover.bag.repair.check import check
from sms_handover.bag.repair.recover import recover
from sms_handover.bag.time_order import TimeSpan
from sms_handover.errors import BagError
from sms_handover.export.export import CSV, export
from sms_handover.export.selection import Selection
from sms_handover.playback.source import PlaybackSource

SUITE = Path(__file__).resolve().parent.parent / "data" / "mcap_conformance"
FILES = 416


class Expected(NamedTuple):
    """The content of a file: messages as (log time, publish time, data), the rest by number."""

    messages: list[tuple[int, int, bytes]]
    attachments: int
    records: int


def expected(description: dict[str, list[dict[str, object]]]) -> Expected:
    """Return what is in the file of a description."""
    found: dict[str, list[dict[str, object]]] = {}
    for record in description["records"]:
        found.setdefault(str(record["type"]), []).append(dict(record["fields"]))  # type: ignore[call-overload]
    messages = [
        (int(str(f["log_time"])), int(str(f["publish_time"])), bytes(map(int, f["data"])))  # type: ignore[call-overload]
        for f in found.get("Message", [])
    ]
    return Expected(messages, len(found.get("Attachment", [])), len(found.get("Metadata", [])))


def test_every_file_of_the_conformance_suite_is_read_in_full(tmp_path: Path) -> None:
    for name in ("mcap_conformance", "mcap_conformance_json"):
        with tarfile.open(SUITE / f"{name}.tar.xz") as archive:
            archive.extractall(tmp_path / name, filter="data")
    files = sorted((tmp_path / "mcap_conformance").rglob("*.mcap"))
    assert len(files) == FILES
    (description,) = [item for item in (tmp_path / "mcap_conformance_json").rglob("OneMessage")]
    wrong = []
    for file in files:
        where = description.parent / file.parent.name / f"{file.stem}.json"
        must = expected(json.loads(where.read_text()))
        try:
            folder = tmp_path / "new" / file.stem
            folder.mkdir(parents=True)
            hold_against(file, must, folder)
        except (AssertionError, BagError) as error:
            wrong.append(f"{file.stem}: {' '.join(str(error).split())[:300]}")
    assert not wrong, "\n".join(wrong)


def hold_against(file: Path, must: Expected, folder: Path) -> None:
    """Read a file in every way and compare; ``folder`` is for what is made of it."""
    info = read_info(file)
    assert (info.message_count, len(info.attachments), len(info.records)) == (
        len(must.messages),
        must.attachments,
        must.records,
    ), "info"
    result = check(file)
    assert result.complete, f"check: {result.findings}"
    topics = frozenset(info.topics)
    keys = {(topic.name, topic.type) for topic in info.channels}
    played = PlaybackSource(file, keys, {}, info.start_ns, TimeSpan(info.start_ns, info.end_ns))
    found = [(m.log_time_ns, m.publish_time_ns, m.data) for m in played.read(info.start_ns)]
    assert found == sorted(must.messages, key=lambda message: message[0]), "play"
    recovery = recover(file, folder / "recovered")
    assert recovery.clean, f"recover: {recovery.losses}"
    again = [(m.log_time_ns, m.publish_time_ns, m.data) for m in read_messages(folder / "recovered")]
    assert again == must.messages, "recovered"
    try:
        export(file, folder / "tables", CSV, Selection())
        raise AssertionError("messages in encoding 'a' have no columns")
    except BagError as error:  # no topic of the suite is CDR
        assert "nothing to export" in str(error) and all(topic in str(error) for topic in topics), str(error)
