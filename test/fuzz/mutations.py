"""Inputs that are nearly right: a good one with some bytes or words changed, as Hypothesis draws them."""

import struct
from collections.abc import Sequence
from functools import partial
from random import Random

from hypothesis import strategies as st

_WORDS = [
    *(
        b"nan .nan inf .inf -.inf 1e999 -1 0 null ~ true '' \"\" [] {} [ ] { } : - ? ! & * < > | % @ `"
    ).split(),
    *(
        b"!!python/none !!int !!float !!binary !!timestamp !!set !!omap <<: &a *a --- ... 2001-02-30 1:99"
    ).split(),
    *(b"0x 0b2 1_0 .5. +1 -0 1e-400").split(),
    b"9" * 400,
    b"\n",
    b"\n  ",
    b"\t",
    b": ",
    b"- ",
    b"\xff\xfe",
    "é\u2028\U0001f600".encode(),
]
_NUMBERS = [
    *(bytes([byte]) * size for byte in (0x00, 0x01, 0x7F, 0x80, 0xFF) for size in (1, 2, 4, 8)),
    *(struct.pack("<d", value) for value in (float("nan"), float("inf"), 1e308, -0.0, 1.0)),
    *(struct.pack("<Q", 2**power) for power in (16, 31, 32, 40, 62, 63)),
]
_OPERATIONS = ("overwrite", "insert", "delete", "repeat", "cut", "swap", "splice", "flip")

_edit = st.tuples(
    st.sampled_from(_OPERATIONS),
    st.integers(0, 2**20),  # place
    st.integers(0, 2**20),  # a second place, or a length
    st.one_of(st.sampled_from(_WORDS), st.sampled_from(_NUMBERS), st.binary(max_size=9)),
)


def mutated(seeds: Sequence[bytes]) -> st.SearchStrategy[bytes]:
    """Return what draws one of the seeds with up to eight edits, or now and then any bytes."""
    nearly = st.builds(_mutate, st.sampled_from(seeds), st.lists(_edit, max_size=8), st.sampled_from(seeds))
    return st.one_of(nearly, nearly, nearly, st.binary(max_size=200))


def mutated_by(random: Random, seeds: Sequence[bytes]) -> bytes:
    """Return one of the seeds with up to eight edits that a generator of random numbers draws."""
    payloads, place = [*_WORDS, *_NUMBERS], partial(random.randrange, 2**20)
    edits = [
        (random.choice(_OPERATIONS), place(), place(), random.choice(payloads))
        for _ in range(random.randrange(9))
    ]
    return _mutate(random.choice(seeds), edits, random.choice(seeds))


def _mutate(data: bytes, edits: Sequence[tuple[str, int, int, bytes]], other: bytes) -> bytes:
    """Return data with edits, some of which put in a part of another input."""
    for operation, first, second, payload in edits:
        data = _edited(data, operation, first % (len(data) + 1), second, payload, other)
    return data


def _edited(data: bytes, operation: str, at: int, second: int, payload: bytes, other: bytes) -> bytes:
    """Return data with one edit at a place."""
    length = second % 65
    head, tail = data[:at], data[at:]
    if operation == "overwrite":
        return head + payload + data[at + len(payload) :]
    if operation == "insert":
        return head + payload + tail
    if operation == "delete":
        return head + data[at + length :]
    if operation == "repeat":
        return head + tail[:length] * (second % 5) + tail
    if operation == "cut":
        return head
    if operation == "swap":
        return tail + head
    if operation == "splice":
        return head + other[second % (len(other) + 1) :]
    return head + bytes([tail[0] ^ (1 << second % 8)]) + tail[1:] if tail else data
