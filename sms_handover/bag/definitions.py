"""The schemas and channels that the end of an MCAP file tells again, for when the first ones are lost."""

import struct
import zlib
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from sms_handover.bag.frames import MAGIC
from sms_handover.bag.records import RECORD_HEAD, Fit, fit, parse

_FOOTER = struct.Struct("<BQQQI")  # opcode, length, begin of summary and of its offsets [byte], CRC
_FOOTER_LENGTH = _FOOTER.size - RECORD_HEAD.size  # [byte]
_CHECKSUM_SIZE = 4  # [byte]


def definitions_at_end(stream: BinaryIO, size: int) -> tuple[dict[int, Schema], dict[int, Channel]]:
    """Return schemas and channels by number; none unless the end of the file is as it was written."""
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    summary = _summary(stream, size)
    place = 0
    while place + RECORD_HEAD.size <= len(summary):
        opcode, length = RECORD_HEAD.unpack_from(summary, place)
        begin = place + RECORD_HEAD.size
        place = begin + length
        body = summary[begin:place]
        if len(body) != length or fit(opcode, body) is Fit.NONE:
            break
        if opcode == Opcode.SCHEMA:
            schema = parse(opcode, body)
            schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = parse(opcode, body)
            channels[channel.id] = channel
    return schemas, channels


def _summary(stream: BinaryIO, size: int) -> bytes:
    """Return the summary section of a file, b"" if there is none or its checksum does not hold."""
    end = size - _FOOTER.size - len(MAGIC)
    if end < len(MAGIC):
        return b""
    stream.seek(end)
    footer, magic = stream.read(_FOOTER.size), stream.read()
    opcode, length, begin, _, checksum = _FOOTER.unpack(footer)
    if (opcode, length, magic) != (Opcode.FOOTER, _FOOTER_LENGTH, MAGIC) or not 0 < begin <= end:
        return b""
    stream.seek(begin)
    summary = stream.read(end - begin)
    sound = zlib.crc32(footer[:-_CHECKSUM_SIZE], zlib.crc32(summary)) == checksum
    return summary if sound or checksum == 0 else b""
