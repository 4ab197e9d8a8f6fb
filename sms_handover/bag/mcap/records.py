"""MCAP records from bytes that may be damaged: only a record that fits its own length is read."""

import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from typing import Any

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

RECORD_HEAD = struct.Struct("<BQ")  # opcode, length of what follows [byte]
MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time [ns], publish time [ns]

_CHUNK_HEAD = struct.Struct("<QQQII")  # first and last log time [ns], size [byte], CRC, length of a text
_INDEX_HEAD = struct.Struct("<HI")  # channel, length of its entries [byte]
_LENGTH = struct.Struct("<Q")
_CHECKSUM = struct.Struct("<I")
_LONGEST = 2**40  # [byte] no record is longer

_READ: dict[int, Callable[[ReadDataStream], Any]] = {
    Opcode.HEADER: Header.read,
    Opcode.FOOTER: Footer.read,
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.MESSAGE_INDEX: MessageIndex.read,
    Opcode.CHUNK_INDEX: ChunkIndex.read,
    Opcode.ATTACHMENT: Attachment.read,
    Opcode.ATTACHMENT_INDEX: AttachmentIndex.read,
    Opcode.STATISTICS: Statistics.read,
    Opcode.METADATA: Metadata.read,
    Opcode.METADATA_INDEX: MetadataIndex.read,
    Opcode.SUMMARY_OFFSET: SummaryOffset.read,
    Opcode.DATA_END: DataEnd.read,
}
_KNOWN = frozenset(Opcode)
_ERRORS = (struct.error, EndOfFile, UnicodeDecodeError, ValueError, OverflowError, MemoryError)


@dataclass(frozen=True)
class ChunkHead:
    """The fields of a chunk; its records are ``size`` bytes from ``begin`` on in its body."""

    start_ns: int
    end_ns: int
    uncompressed_size: int
    checksum: int
    compression: str
    begin: int
    size: int


def plausible_head(opcode: int, length: int) -> bool:
    """Whether a record may begin like this."""
    return opcode in _KNOWN and length < _LONGEST


def fits(opcode: int, body: bytes) -> bool:
    """Whether a body is a record of this kind: every length in it agrees with the whole."""
    if opcode == Opcode.CHUNK:
        head = chunk_head(body)
        return head is not None and head.begin + head.size == len(body)
    if opcode == Opcode.MESSAGE:
        return len(body) >= MESSAGE_HEAD.size
    if opcode == Opcode.MESSAGE_INDEX:
        return _INDEX_HEAD.size + _stated(body) == len(body)
    try:
        return opcode in _READ and _parse(opcode, body)[1].count == len(body)
    except _ERRORS:
        return False


def parse(opcode: int, body: bytes) -> Any:
    """Return the record in a body that fits, None for a chunk or message."""
    return _parse(opcode, body)[0] if opcode in _READ else None


def chunk_head(body: bytes) -> ChunkHead | None:
    """Return the fields at the beginning of a chunk, None if they are malformed."""
    try:
        start_ns, end_ns, size, checksum, length = _CHUNK_HEAD.unpack_from(body)
        text_end = _CHUNK_HEAD.size + length
        compression = body[_CHUNK_HEAD.size : text_end].decode("ascii")
        (stored,) = _LENGTH.unpack_from(body, text_end)
    except (struct.error, UnicodeDecodeError):
        return None
    return ChunkHead(start_ns, end_ns, size, checksum, compression, text_end + _LENGTH.size, stored)


def attachment_is_sound(body: bytes) -> bool:
    """Whether the checksum of an attachment matches, or there is none."""
    (stored,) = _CHECKSUM.unpack_from(body, len(body) - _CHECKSUM.size)
    return stored in (0, zlib.crc32(body[: -_CHECKSUM.size]))


def _stated(body: bytes) -> int:
    """Return the length in byte that a message index claims for its entries, -1 if it claims none."""
    return int(_INDEX_HEAD.unpack_from(body)[1]) if len(body) >= _INDEX_HEAD.size else -1


class _StrictStream(ReadDataStream):
    """A stream whose reads are whole or fail."""

    def read(self, length: int) -> bytes:
        """Return exactly ``length`` bytes; raises EndOfFile if there are fewer."""
        data = super().read(length)
        if len(data) != length:
            raise EndOfFile
        return data


def _parse(opcode: int, body: bytes) -> tuple[Any, ReadDataStream]:
    """Return a record and the stream behind it; raises one of ``_ERRORS``."""
    stream = _StrictStream(BytesIO(body))
    return _READ[opcode](stream), stream
