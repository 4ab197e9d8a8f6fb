"""Find the records of an MCAP file one after another, and go on behind places that are damaged."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO, NamedTuple

from mcap.opcode import Opcode

from sms_handover.bag.mcap.records import RECORD_HEAD, chunk_head, fits, plausible_head

MAGIC = b"\x89MCAP0\r\n"  # the first and the last bytes of a complete file

_SEARCH_BLOCK = 2**20  # [byte] looked through at once
_HEAD_OF_CHUNK = 64  # [byte] enough to judge whether a chunk begins
_LARGEST_INDEX = 2**26  # [byte] a record other than a chunk or an attachment that claims more is none
_CHECKED = (Opcode.CHUNK, Opcode.ATTACHMENT)
_IN_CHUNKS = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)
# a record whose length is below 2**40: how the search behind damage recognises where one may begin
_CANDIDATE = re.compile(rb"(?=[\x03-\x0f].{5}\0\0\0)", re.DOTALL)


class Frame(NamedTuple):
    """A record in a file, from byte ``begin`` to ``end``; ``body`` is without opcode and length."""

    begin: int
    end: int
    opcode: int
    body: bytes


@dataclass(frozen=True)
class Gap:
    """Bytes that are no record; of one that the end of the file cuts off, opcode and what there is of it."""

    begin: int
    end: int
    reason: str
    opcode: int = 0
    body: bytes = b""


class FrameWalk:
    """The records at the top level of a file, in order."""

    def __init__(self, stream: BinaryIO, size: int) -> None:
        """Walk through the ``size`` bytes of a stream."""
        self._stream = stream
        self._size = size
        self._newest: Frame | None = None
        self._chunked: bool | None = None  # whether messages lie in chunks; None until that is known

    def __iter__(self) -> Iterator[Frame | Gap]:
        """Yield every record and every gap; the magic at both ends is neither."""
        place = 0
        if self._bytes(0, len(MAGIC)) == MAGIC:
            place = len(MAGIC)
        elif self._frame(len(MAGIC)) is not None:
            yield Gap(0, len(MAGIC), "it does not begin as an MCAP file does")
            place = len(MAGIC)
        while place < self._size and not self._is_end(place):
            found = self._trusted(place) or self._gap(place)
            if self._chunked is None and found.opcode in (Opcode.CHUNK, Opcode.MESSAGE):
                self._chunked = found.opcode == Opcode.CHUNK
            yield found
            place = found.end

    def _frame(self, place: int) -> Frame | None:
        """Return the record at a place, None if there is none that is whole; the newest is kept at hand."""
        if self._newest is None or self._newest.begin != place:
            self._newest = self._read_frame(place)
        return self._newest

    def _read_frame(self, place: int) -> Frame | None:
        """Read the record at a place."""
        head = self._head(place)
        if head is None:
            return None
        opcode, length = head
        end = place + RECORD_HEAD.size + length
        if end > self._size or not plausible_head(opcode, length):
            return None
        if opcode == Opcode.CHUNK and not self._chunk_begins(place):
            return None
        frame = Frame(place, end, opcode, self._bytes(place + RECORD_HEAD.size, length))
        return frame if fits(opcode, frame.body) else None

    def _trusted(self, place: int) -> Frame | None:
        """Return the record at a place if nothing speaks against it.

        A chunk and an attachment have checksums to be judged by. Of any other record a wrong length
        shows by no record following, while one begins within what it claims for itself.
        """
        frame = self._frame(place)
        if frame is None or frame.opcode in _CHECKED or self._goes_on(frame.end):
            return None if frame is not None and self._stray(frame) else frame
        if frame.opcode == Opcode.MESSAGE:
            return None
        first = next((found for found in self._candidates(place + 1) if self._resumes(found)), frame.end)
        return frame if first >= frame.end else None

    def _stray(self, frame: Frame) -> bool:
        """Whether it is a message outside of the chunks of a file that has chunks."""
        return frame.opcode == Opcode.MESSAGE and self._chunked is True

    def _gap(self, place: int) -> Gap:
        """Return the bytes up to the next record."""
        cut = self._cut(place)
        if cut is not None and self._chunk_begins(place):
            return cut
        for candidate in self._candidates(place + 1):
            if self._is_end(candidate) or self._resumes(candidate):
                return Gap(place, candidate, "what is there is no record")
        return cut or Gap(place, self._size, "no record is found from there to the end")

    def _cut(self, place: int) -> Gap | None:
        """Return what looks like a record that the end of the file cuts off."""
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
        """Whether a record begins at a place for sure, so that the walk can go on there."""
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
        """Whether messages lie in chunks: then what looks like one elsewhere is in a broken chunk."""
        if self._chunked is None:
            chunks = (c for c in self._candidates(place) if (self._head(c) or (0,))[0] == Opcode.CHUNK)
            self._chunked = any(self._frame(chunk) is not None for chunk in chunks)
        return self._chunked

    def _candidates(self, place: int) -> Iterator[int]:
        """Yield the places from ``place`` on where a record, or the end of the file, may begin."""
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
        """Tell by its first bytes whether a chunk is at a place, before all of it is read."""
        opcode, length = self._head(place) or (0, 0)
        head = chunk_head(self._bytes(place + RECORD_HEAD.size, min(length, _HEAD_OF_CHUNK)))
        return opcode == Opcode.CHUNK and head is not None and head.begin + head.size == length

    def _goes_on(self, place: int) -> bool:
        """Whether a record, one that the end of the file cuts off, or that end itself is at a place."""
        if place == self._size or self._is_end(place):
            return True
        head = self._head(place)
        if head is None:
            return True
        if place + RECORD_HEAD.size + head[1] > self._size:
            return plausible_head(*head)
        return self._frame(place) is not None

    def _is_end(self, place: int) -> bool:
        """Whether the magic that ends a file is at a place."""
        return place == self._size - len(MAGIC) and self._bytes(place, len(MAGIC)) == MAGIC

    def _head(self, place: int) -> tuple[int, int] | None:
        """Return opcode and length at a place, None at the end of the file."""
        head = self._bytes(place, RECORD_HEAD.size)
        if len(head) < RECORD_HEAD.size:
            return None
        opcode, length = RECORD_HEAD.unpack(head)
        return opcode, length

    def _bytes(self, place: int, length: int) -> bytes:
        """Return bytes of the file, fewer at its end."""
        self._stream.seek(place)
        return self._stream.read(length)
