"""Find the records of an MCAP file one after another, and go on behind places that are damaged."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO, NamedTuple

from mcap.opcode import Opcode

from sms_handover.bag.records import RECORD_HEAD, Fit, chunk_head, fit, plausible_head

MAGIC = b"\x89MCAP0\r\n"  # the first and the last bytes of a complete file

_SEARCH_BLOCK = 2**20  # [byte] looked through at once
_HEAD_OF_CHUNK = 64  # [byte] enough to judge whether a chunk begins
_LARGEST_INDEX = 2**26  # [byte] a record other than a chunk or an attachment that claims more is none
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
        self._chunked = False

    def __iter__(self) -> Iterator[Frame | Gap]:
        """Yield every record and every gap; the magic at both ends is neither."""
        place = 0
        if self._bytes(0, len(MAGIC)) == MAGIC:
            place = len(MAGIC)
        elif self._frame(len(MAGIC)) is not None:
            yield Gap(0, len(MAGIC), "it does not begin as an MCAP file does")
            place = len(MAGIC)
        while place < self._size and not self._is_end(place):
            found = self._frame(place) or self._gap(place)
            if isinstance(found, Frame):
                self._chunked = self._chunked or found.opcode == Opcode.CHUNK
            yield found
            place = found.end

    def _frame(self, place: int) -> Frame | None:
        """Return the record at a place, None if there is none that is whole."""
        head = self._head(place)
        if head is None:
            return None
        opcode, length = head
        begin = place + RECORD_HEAD.size
        end = begin + length
        if end > self._size or not plausible_head(opcode, length):
            return None
        if opcode == Opcode.CHUNK and not self._chunk_begins(begin, length):
            return None
        frame = Frame(place, end, opcode, self._bytes(begin, length))
        how = fit(opcode, frame.body)
        return frame if how is Fit.EXACT or (how is Fit.LOOSE and self._goes_on(end)) else None

    def _gap(self, place: int) -> Gap:
        """Return the bytes up to the next record."""
        for candidate in self._candidates(place + 1):
            if self._is_end(candidate) or self._resumes(candidate):
                return Gap(place, candidate, "what is there is no record")
        head = self._head(place)
        if head is None:
            return Gap(place, self._size, "the file ends within the head of a record")
        opcode, length = head
        begin = place + RECORD_HEAD.size
        if plausible_head(opcode, length) and begin + length > self._size:
            reason = f"the file ends within a record, {begin + length - self._size} bytes of it are missing"
            return Gap(place, self._size, reason, opcode, self._bytes(begin, self._size - begin))
        return Gap(place, self._size, "no record is found from there to the end")

    def _resumes(self, place: int) -> bool:
        """Tell whether a record begins at a place for sure, so that the walk can go on there."""
        head = self._head(place)
        if head is None or (head[0] == Opcode.MESSAGE and self._chunked):
            return False
        if head[0] not in (Opcode.CHUNK, Opcode.ATTACHMENT) and head[1] > _LARGEST_INDEX:
            return False
        frame = self._frame(place)
        return frame is not None and self._goes_on(frame.end)

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

    def _chunk_begins(self, begin: int, length: int) -> bool:
        """Tell by its first bytes whether a body is that of a chunk, before all of it is read."""
        head = chunk_head(self._bytes(begin, min(length, _HEAD_OF_CHUNK)))
        return head is not None and head.begin + head.size == length

    def _goes_on(self, place: int) -> bool:
        """Tell whether a record, or the end of the file, may be at a place."""
        if place == self._size or self._is_end(place):
            return True
        head = self._head(place)
        return head is None or plausible_head(*head)  # a head that is not whole is the end of a cut file

    def _is_end(self, place: int) -> bool:
        """Tell whether the magic that ends a file is at a place."""
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
