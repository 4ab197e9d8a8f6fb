"""The schemas and channels that the end of an MCAP file tells again, for when the first ones are lost."""

import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from sms_handover.bag.mcap.records import RECORD_HEAD, fits, parse
from sms_handover.bag.mcap.resync import MAGIC

_FOOTER = struct.Struct("<BQQQI")  # opcode, length, begin of summary and of its offsets [byte], CRC
_FOOTER_LENGTH = _FOOTER.size - RECORD_HEAD.size  # [byte]
_DATA_END = RECORD_HEAD.pack(Opcode.DATA_END, 4)
_LARGEST_SUMMARY = 2**26  # [byte] in which the record is looked for
_CHECKSUM_SIZE = 4  # [byte]


@dataclass(frozen=True)
class Definitions:
    """Schemas and channels by number; not ``sound`` if the checksum over them does not hold."""

    schemas: Mapping[int, Schema]
    channels: Mapping[int, Channel]
    sound: bool


def definitions_at_end(stream: BinaryIO, size: int) -> Definitions:
    """Return what the end of a file tells; nothing unless it is as it was written."""
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    found = _summary(stream, size)
    summary = found or b""
    place = 0
    while place + RECORD_HEAD.size <= len(summary):
        opcode, length = RECORD_HEAD.unpack_from(summary, place)
        begin = place + RECORD_HEAD.size
        place = begin + length
        body = summary[begin:place]
        if len(body) != length or not fits(opcode, body):
            break
        if opcode == Opcode.SCHEMA:
            schema = parse(opcode, body)
            schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = parse(opcode, body)
            channels[channel.id] = channel
    return Definitions(schemas, channels, found is not None)


def _summary(stream: BinaryIO, size: int) -> bytes | None:
    """Return the summary section of a file, b"" if there is none, None if its checksum does not hold."""
    end = size - _FOOTER.size - len(MAGIC)
    if end < len(MAGIC):
        return b""
    stream.seek(end)
    footer, magic = stream.read(_FOOTER.size), stream.read()
    opcode, length, begin, _, checksum = _FOOTER.unpack(footer)
    if (opcode, length, magic) != (Opcode.FOOTER, _FOOTER_LENGTH, MAGIC) or begin == 0:
        return b""
    for place in (begin, _behind_data(stream, end)):
        if 0 < place <= end:
            stream.seek(place)
            summary = stream.read(end - place)
            if checksum == 0 or zlib.crc32(footer[:-_CHECKSUM_SIZE], zlib.crc32(summary)) == checksum:
                return summary
    return None


def _behind_data(stream: BinaryIO, end: int) -> int:
    """Return where the data ends by the record that says so, for when bytes before it went missing."""
    begin = max(0, end - _LARGEST_SUMMARY)
    stream.seek(begin)
    found = stream.read(end - begin).rfind(_DATA_END)
    return begin + found + len(_DATA_END) + _CHECKSUM_SIZE if found >= 0 else 0
