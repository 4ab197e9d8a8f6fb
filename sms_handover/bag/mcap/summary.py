"""The summary of an MCAP file, also of one that was written without any."""

from pathlib import Path

from mcap.reader import McapReader
from mcap.records import Channel, Statistics
from mcap.summary import Summary

from sms_handover.bag.mcap.scan import FileScan, ScannedMessage, Source


def file_summary(reader: McapReader, file: Path) -> tuple[Summary, Statistics]:
    """Return schemas, channels and counts from the end of a file, or by going through all of it."""
    summary = reader.get_summary()
    if summary is not None and summary.statistics is not None and summary.channels:
        return summary, summary.statistics
    return _scan(file)


def _scan(file: Path) -> tuple[Summary, Statistics]:
    """Return the summary of all records of a file."""
    summary = Summary()
    numbers: dict[Source, int] = {}
    counts: dict[int, int] = {}
    start_ns, end_ns = None, 0

    def number_of(source: Source) -> int:
        if source not in numbers:
            numbers[source] = channel = len(numbers) + 1
            summary.schemas[channel] = source.schema
            summary.channels[channel] = Channel(
                channel, source.topic, source.encoding, dict(source.metadata), channel
            )
        return numbers[source]

    for found in FileScan(file):
        if isinstance(found, Source):
            number_of(found)
        elif isinstance(found, ScannedMessage):
            channel = number_of(found.source)
            counts[channel] = counts.get(channel, 0) + 1
            start_ns = found.log_time_ns if start_ns is None else min(start_ns, found.log_time_ns)
            end_ns = max(end_ns, found.log_time_ns)
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
