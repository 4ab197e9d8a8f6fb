"""Summary section at the end of an MCAP file: what it states about the file, and whether it is intact."""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Channel, ChunkIndex, MetadataIndex, Schema, Statistics

from sms_handover.bag.mcap.records import RECORD_HEAD, parse, used_length
from sms_handover.bag.mcap.resync import MAGIC

_FOOTER = struct.Struct("<BQQQI")  # opcode, length, begin of summary and of its offsets [byte], CRC
_FOOTER_LENGTH = _FOOTER.size - RECORD_HEAD.size  # [byte]
_DATA_END = RECORD_HEAD.pack(Opcode.DATA_END, 4)
_LARGEST_SUMMARY = 2**26  # [byte] in which the record is searched
_CHECKSUM_SIZE = 4  # [byte]


@dataclass
class SummarySection:
    """The records of a summary from byte ``begin`` on; not ``sound`` if its checksum does not match.

    ``begin`` is 0 without a summary. Schemas and channels are by number.
    """

    sound: bool = True
    begin: int = 0
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    statistics: Statistics | None = None
    chunks: list[ChunkIndex] = field(default_factory=list)
    files: list[AttachmentIndex | MetadataIndex] = field(default_factory=list)


def read_summary_section(stream: BinaryIO, size: int) -> SummarySection:
    """Return the summary section of a file of ``size`` bytes, empty unless it is intact."""
    begin, summary = _intact(stream, size)
    section = SummarySection(summary is not None, begin)
    for opcode, body in _records(summary or b""):
        record = parse(opcode, body)
        if isinstance(record, Schema):
            section.schemas[record.id] = record
        elif isinstance(record, Channel):
            section.channels[record.id] = record
        elif isinstance(record, Statistics):
            section.statistics = record
        elif isinstance(record, ChunkIndex):
            section.chunks.append(record)
        elif isinstance(record, AttachmentIndex | MetadataIndex):
            section.files.append(record)
    return section


def _records(summary: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and body of the whole records of a summary."""
    place = 0
    while place + RECORD_HEAD.size <= len(summary):
        opcode, length = RECORD_HEAD.unpack_from(summary, place)
        begin = place + RECORD_HEAD.size
        place = begin + length
        body = summary[begin:place]
        if len(body) != length or used_length(opcode, body) is None:
            break
        yield opcode, body


def _intact(stream: BinaryIO, size: int) -> tuple[int, bytes | None]:
    """Return begin and bytes of a summary: (0, b"") if there is none, (0, None) on a wrong checksum."""
    end = size - _FOOTER.size - len(MAGIC)
    if end < len(MAGIC):
        return 0, b""
    stream.seek(end)
    footer, magic = stream.read(_FOOTER.size), stream.read()
    opcode, length, begin, _, checksum = _FOOTER.unpack(footer)
    if (opcode, length, magic) != (Opcode.FOOTER, _FOOTER_LENGTH, MAGIC) or begin == 0:
        return 0, b""
    for place in (begin, _behind_data(stream, end)):
        if 0 < place <= end:
            stream.seek(place)
            summary = stream.read(end - place)
            if checksum == 0 or zlib.crc32(footer[:-_CHECKSUM_SIZE], zlib.crc32(summary)) == checksum:
                return place, summary
    return 0, None


def _behind_data(stream: BinaryIO, end: int) -> int:
    """Return the end of the DataEnd record, for files of which bytes before it are missing."""
    begin = max(0, end - _LARGEST_SUMMARY)
    stream.seek(begin)
    found = stream.read(end - begin).rfind(_DATA_END)
    return begin + found + len(_DATA_END) + _CHECKSUM_SIZE if found >= 0 else 0
