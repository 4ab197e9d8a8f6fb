"""Records of a chunk, whole or cut off, provided that size and checksum match."""

import zlib
from collections.abc import Iterator
from typing import NamedTuple

import lz4.frame
import zstandard
from mcap.opcode import Opcode

from sms_handover.bag.mcap.compression import COMPRESSION_ERRORS, inflate
from sms_handover.bag.mcap.records import MESSAGE_HEAD, RECORD_HEAD, ChunkHead, plausible_head, used_length


class Inner(NamedTuple):
    """A record within a chunk."""

    opcode: int
    begin: int
    end: int


class DamagedChunkError(Exception):
    """The records of a chunk are unreadable; the text says why."""


def records_of(head: ChunkHead, body: bytes) -> bytes:
    """Return the records of a whole chunk; raises DamagedChunkError unless they are intact."""
    stored = memoryview(body)[head.begin : head.begin + head.size]
    try:
        records = inflate(head.compression, stored, head.uncompressed_size)
    except COMPRESSION_ERRORS as error:
        raise DamagedChunkError(f"the chunk does not decompress: {' '.join(str(error).split())}") from error
    if len(records) != head.uncompressed_size:
        raise DamagedChunkError(f"the chunk holds {len(records)} bytes instead of {head.uncompressed_size}")
    if head.checksum and zlib.crc32(records) != head.checksum:
        raise DamagedChunkError("the checksum of the chunk does not match")
    return records


def records_of_cut(head: ChunkHead, body: bytes) -> bytes:
    """Return the readable records of a chunk of which only the beginning is there."""
    stored = body[head.begin :]
    try:
        if head.compression == "zstd":
            return zstandard.ZstdDecompressor().decompressobj().decompress(stored)
        if head.compression == "lz4":
            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(stored))
    except COMPRESSION_ERRORS:
        return b""
    return stored if head.compression == "" else b""


def inner_records(records: bytes) -> Iterator[Inner]:
    """Yield the whole records of a chunk, up to the first that is not."""
    place, size = 0, len(records)
    while place + RECORD_HEAD.size <= size:
        opcode, length = RECORD_HEAD.unpack_from(records, place)
        begin = place + RECORD_HEAD.size
        end = begin + length
        if end > size or not plausible_head(opcode, length):
            return
        if opcode == Opcode.MESSAGE:
            if length < MESSAGE_HEAD.size:
                return
        elif used_length(opcode, records[begin:end]) is None:
            return
        yield Inner(opcode, begin, end)
        place = end
