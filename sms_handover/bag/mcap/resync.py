"""Resync: the records of an MCAP file one after another, resuming behind damage."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO, NamedTuple

from mcap.opcode import Opcode

from sms_handover.bag.mcap.records import RECORD_HEAD, chunk_head, is_misread, plausible_head, used_length

MAGIC = b"\x89MCAP0\r\n"  # the first and the last bytes of a complete file

_SEARCH_BLOCK = 2**20  # [byte] searched at once
_HEAD_OF_CHUNK = 64  # [byte] enough for the fields of a chunk
_LARGEST_INDEX = 2**26  # [byte] no other record than a chunk or attachment is longer
_CHECKED = (Opcode.CHUNK, Opcode.ATTACHMENT)
_IN_CHUNKS = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)
# opcode and length below 2**40: where a record may begin, for the search behind damage
_CANDIDATE = re.compile(rb"(?=[\x03-\x0f].{5}\0\0\0)", re.DOTALL)


class Frame(NamedTuple):
    """A record in a file, from byte ``begin`` to ``end``.

    ``body`` is without opcode and length; its known fields take ``used`` bytes.
    """

    begin: int
    end: int
    opcode: int
    body: bytes
    used: int


@dataclass(frozen=True)
class Gap:
    """Bytes that are no record; of one cut off by the end of the file, its opcode and beginning."""

    begin: int
    end: int
    reason: str
    opcode: int = 0
    body: bytes = b""


class FrameWalk:
    """The records at the top level of a file, in order."""

    def __init__(self, stream: BinaryIO, size: int) -> None:
        self._stream = stream
        self._size = size
        self._latest: Frame | None = None
        self._in_index = False  # behind a chunk or one of its message indexes
        self._chunked: bool | None = None  # whether messages are in chunks; None if not known yet

    def __iter__(self) -> Iterator[Frame | Gap]:
        """Yield every record and gap, without the magic at both ends."""
        place = 0
        if self._bytes(0, len(MAGIC)) == MAGIC:
            place = len(MAGIC)
        elif self._frame(len(MAGIC)) is not None:
            yield Gap(0, len(MAGIC), "the magic of an MCAP file is missing")
            place = len(MAGIC)
        while place < self._size and not self._is_end(place):
            found = self._trusted(place) or self._gap(place)
            if found.opcode == Opcode.CHUNK:
                self._chunked = True
            self._in_index = found.opcode in (Opcode.CHUNK, Opcode.MESSAGE_INDEX)
            yield found
            place = found.end

    def _frame(self, place: int) -> Frame | None:
        """Return the whole record at a place, None without one; the latest is cached."""
        if self._latest is None or self._latest.begin != place:
            self._latest = self._read_frame(place)
        return self._latest

    def _read_frame(self, place: int) -> Frame | None:
        head = self._head(place)
        if head is None:
            return None
        opcode, length = head
        end = place + RECORD_HEAD.size + length
        if end > self._size or not plausible_head(opcode, length):
            return None
        if opcode == Opcode.CHUNK and not self._chunk_begins(place):
            return None
        body = self._bytes(place + RECORD_HEAD.size, length)
        used = used_length(opcode, body)
        return None if used is None else Frame(place, end, opcode, body, used)

    def _trusted(self, place: int) -> Frame | None:
        """Return the record at a place unless it is implausible.

        Chunks and attachments have checksums. The length of any other record is wrong if no record
        follows it, but one begins within it.
        """
        frame = self._frame(place)
        if frame is None or (self._in_index and frame.opcode == Opcode.MESSAGE and is_misread(frame.body)):
            return None
        exact = frame.opcode in _CHECKED and frame.used == len(frame.body)
        if exact or self._goes_on(frame.end):
            return frame
        if frame.opcode == Opcode.MESSAGE:
            return None
        first = next((found for found in self._candidates(place + 1) if self._resumes(found)), frame.end)
        return frame if first >= frame.end else None

    def _gap(self, place: int) -> Gap:
        """Return the bytes up to the next record."""
        cut = self._cut(place)
        if cut is not None and self._chunk_begins(place):
            return cut
        for candidate in self._candidates(place + 1):
            if self._is_end(candidate) or self._resumes(candidate):
                return Gap(place, candidate, "no record")
        return cut or Gap(place, self._size, "no record up to the end of the file")

    def _cut(self, place: int) -> Gap | None:
        """Return what looks like a record cut off by the end of the file."""
        head = self._head(place)
        if head is None:
            return Gap(place, self._size, "the file ends within the head of a record")
        opcode, length = head
        begin = place + RECORD_HEAD.size
        if not plausible_head(opcode, length) or begin + length <= self._size:
            return None
        reason = f"the file ends within a record, {begin + length - self._size} bytes of it are missing"
        return Gap(place, self._size, reason, opcode, self._bytes(begin, self._size - begin))

    def _resumes(self, place: int) -> bool:
        """Whether a record certainly begins at a place, so that the walk can resume there."""
        head = self._head(place)
        if head is None:
            return False
        if head[0] not in _CHECKED and head[1] > _LARGEST_INDEX:
            return False
        frame = self._frame(place)
        if frame is None or not self._goes_on(frame.end):
            return False
        return head[0] not in _IN_CHUNKS or not self._holds_chunks(frame.end)

    def _holds_chunks(self, place: int) -> bool:
        """Whether messages are in chunks: then one elsewhere is in a broken chunk."""
        if self._chunked is None:
            chunks = (c for c in self._candidates(place) if (self._head(c) or (0,))[0] == Opcode.CHUNK)
            self._chunked = any(self._frame(chunk) is not None for chunk in chunks)
        return self._chunked

    def _candidates(self, place: int) -> Iterator[int]:
        start = place
        while place < self._size:
            block = self._bytes(place, _SEARCH_BLOCK + RECORD_HEAD.size)
            yield from (
                place + match.start() for match in _CANDIDATE.finditer(block) if match.start() < _SEARCH_BLOCK
            )
            place += _SEARCH_BLOCK
        if start <= self._size - len(MAGIC):
            yield self._size - len(MAGIC)

    def _chunk_begins(self, place: int) -> bool:
        opcode, length = self._head(place) or (0, 0)
        head = chunk_head(self._bytes(place + RECORD_HEAD.size, min(length, _HEAD_OF_CHUNK)))
        return opcode == Opcode.CHUNK and head is not None and head.begin + head.size <= length

    def _goes_on(self, place: int) -> bool:
        """Whether a record, one cut off by the end of the file, or that end is at a place."""
        if place == self._size or self._is_end(place):
            return True
        head = self._head(place)
        if head is None:
            return True
        if place + RECORD_HEAD.size + head[1] > self._size:
            return plausible_head(*head)
        return self._frame(place) is not None

    def _is_end(self, place: int) -> bool:
        return place == self._size - len(MAGIC) and self._bytes(place, len(MAGIC)) == MAGIC

    def _head(self, place: int) -> tuple[int, int] | None:
        """Return opcode and length at a place, None at the end of the file."""
        head = self._bytes(place, RECORD_HEAD.size)
        if len(head) < RECORD_HEAD.size:
            return None
        opcode, length = RECORD_HEAD.unpack(head)
        return opcode, length

    def _bytes(self, place: int, length: int) -> bytes:
        self._stream.seek(place)
        return self._stream.read(length)
