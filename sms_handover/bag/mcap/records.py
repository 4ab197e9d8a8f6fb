"""MCAP records from bytes that may be damaged: only a record that fits its own length is read.

Records may grow at their end, and opcodes from 0x80 are for private records
(https://mcap.dev/spec): unknown bytes behind the known fields are skipped.
"""

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
PRIVATE = 0x80  # first opcode of private records
_CHECKED = (Opcode.CHUNK, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.ATTACHMENT, Opcode.METADATA)
_ERRORS = (struct.error, EndOfFile, UnicodeDecodeError, ValueError, OverflowError, MemoryError, KeyError)


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
    return (opcode in _KNOWN or opcode >= PRIVATE) and length < _LONGEST


def used_length(opcode: int, body: bytes) -> int | None:
    """Return how many bytes of a body its known fields take, None if it is no record of this kind.

    A private record that is one of MCAP but for the highest bit of its opcode is taken for damage.
    """
    try:
        if opcode == Opcode.MESSAGE:
            used = max(len(body), MESSAGE_HEAD.size)
        elif opcode == Opcode.CHUNK:
            head = chunk_head(body)
            used = _LONGEST if head is None else head.begin + head.size
        elif opcode == Opcode.MESSAGE_INDEX:
            used = _INDEX_HEAD.size + int(_INDEX_HEAD.unpack_from(body)[1])
        elif opcode >= PRIVATE:
            known = opcode - PRIVATE
            used = _LONGEST if known in _CHECKED and used_length(known, body) == len(body) else len(body)
        else:
            used = _parse(opcode, body)[1].count
    except _ERRORS:
        return None
    return used if used <= len(body) else None


def is_misread(body: bytes) -> bool:
    """Whether the body of a message is one of another record, of which a bit of the opcode was flipped."""
    kinds = (*_CHECKED, Opcode.MESSAGE_INDEX)
    return any(used_length(opcode, body) == len(body) for opcode in kinds)


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
    end = _parse(Opcode.ATTACHMENT, body)[1].count - _CHECKSUM.size
    (stored,) = _CHECKSUM.unpack_from(body, end)
    return stored in (0, zlib.crc32(body[:end]))


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
