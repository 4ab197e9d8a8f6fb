"""The summary of an MCAP file, also of one that was written without any."""

from pathlib import Path

from mcap.reader import McapReader
from mcap.records import Channel, Message, Schema, Statistics
from mcap.stream_reader import StreamReader
from mcap.summary import Summary


def file_summary(reader: McapReader, file: Path) -> tuple[Summary, Statistics]:
    """Return schemas, channels and counts from the end of a file, or by going through all of it."""
    summary = reader.get_summary()
    if summary is not None and summary.statistics is not None and summary.channels:
        return summary, summary.statistics
    return _scan(file)


def _scan(file: Path) -> tuple[Summary, Statistics]:
    """Return the summary of all records of a file."""
    summary = Summary()
    counts: dict[int, int] = {}
    start_ns, end_ns = None, 0
    with file.open("rb") as stream:
        for record in StreamReader(stream, record_size_limit=file.stat().st_size).records:
            if isinstance(record, Message):
                counts[record.channel_id] = counts.get(record.channel_id, 0) + 1
                start_ns = record.log_time if start_ns is None else min(start_ns, record.log_time)
                end_ns = max(end_ns, record.log_time)
            elif isinstance(record, Schema):
                summary.schemas[record.id] = record
            elif isinstance(record, Channel):
                summary.channels[record.id] = record
    return summary, Statistics(
        attachment_count=0,
        channel_count=len(summary.channels),
        channel_message_counts=counts,
        chunk_count=0,
        message_count=sum(counts.values()),
        message_end_time=end_ns,
        message_start_time=start_ns or 0,
        metadata_count=0,
        schema_count=len(summary.schemas),
    )
