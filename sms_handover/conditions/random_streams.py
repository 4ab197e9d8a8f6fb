"""Random streams: one for each model, which no other model, law, worker or wall clock moves."""

from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256

import numpy as np

from sms_handover.types import Array, frozen

_DIGEST_BYTES = 16  # of the name of a model: no two names share a stream
_BLOCK = 1024  # [ticks] drawn at once: a draw of few numbers costs a call as well
_PER_COUNT = 4  # [-] uniform numbers that one count of Philox gives
_COUNTER = 2**64  # [-] draws by which two blocks are apart, far more than one of them takes


class RandomStreams:
    """The streams of one run, from its seed and the number of its case in a campaign.

    That of a model is SeedSequence(seed, spawn_key=(case, digest of its name)), so that adding a model moves
    no draw of another. Draws of parameters and noise in the run are to have names of their own.
    """

    def __init__(self, seed: int, case: int = 0) -> None:
        self._seed, self._case = seed, case

    def sequence(self, name: str) -> np.random.SeedSequence:
        """Return what the numbers of a model follow from."""
        digest = int.from_bytes(sha256(name.encode()).digest()[:_DIGEST_BYTES], "big")
        return np.random.SeedSequence(self._seed, spawn_key=(self._case, digest))

    def parameters(self, name: str) -> np.random.Generator:
        """Return the generator of draws that are made once, before the run."""
        return np.random.Generator(np.random.Philox(self.sequence(f"{name}/parameters")))

    def noise(self, name: str, size: int) -> "TickNoise":
        """Return the numbers that a model draws in the run, ``size`` each tick."""
        return TickNoise(self.sequence(f"{name}/noise"), size)


class TickNoise:
    """Standard normal and uniform numbers (size,) of each tick, found by the number of the tick.

    Philox [Salmon2011] counts, so a block of ticks is drawn from its own place in the stream. Whether the
    numbers of the ticks before were used or not changes nothing; a reset or a snapshot needs the tick alone.
    """

    def __init__(self, sequence: np.random.SeedSequence, size: int) -> None:
        self._sequence, self._size = sequence, size
        nothing = _Block(-1, frozen(np.empty((0, size))))
        self._normal = self._uniform = nothing

    def normal(self, tick: int) -> Array:
        """Return the standard normal numbers (size,) of a tick."""
        row: Array = self._normals_of(tick // _BLOCK)[tick % _BLOCK]
        return row

    def uniform(self, tick: int) -> Array:
        """Return the numbers (size,) in [0, 1) of a tick."""
        row: Array = self._uniforms_of(tick // _BLOCK)[tick % _BLOCK]
        return row

    def normals(self, first: int, ticks: int) -> Array:
        """Return the standard normal numbers (ticks, size) of ticks from a first one on."""
        return self._joined(first, ticks, self._normals_of)

    def uniforms(self, first: int, ticks: int) -> Array:
        """Return the numbers (ticks, size) in [0, 1) of ticks from a first one on."""
        return self._joined(first, ticks, self._uniforms_of)

    def _joined(self, first: int, ticks: int, of_block: Callable[[int], Array]) -> Array:
        """Return the rows of ticks out of their blocks."""
        found, tick = np.empty((ticks, self._size)), first
        while tick < first + ticks:
            rows = of_block(tick // _BLOCK)[tick % _BLOCK :][: first + ticks - tick]
            found[tick - first :][: len(rows)] = rows
            tick += len(rows)
        return found

    def _uniforms_of(self, block: int) -> Array:
        """Return the uniform numbers of a block, which come first in its part of the stream."""
        if block != self._uniform.index:
            drawn = self._at(block, 0).random((_BLOCK, self._size))
            self._uniform = _Block(block, frozen(drawn))
        return self._uniform.rows

    def _normals_of(self, block: int) -> Array:
        """Return the standard normal numbers of a block, which come behind its uniform ones."""
        if block != self._normal.index:
            drawn = self._at(block, _BLOCK * self._size).standard_normal((_BLOCK, self._size))
            self._normal = _Block(block, frozen(drawn))
        return self._normal.rows

    def _at(self, block: int, skipped: int) -> np.random.Generator:
        """Return a generator at the part of a block in the stream, behind so many uniform numbers."""
        bits = np.random.Philox(self._sequence)
        bits.advance(block * _COUNTER + skipped // _PER_COUNT)
        return np.random.Generator(bits)


@dataclass(frozen=True, eq=False)
class _Block:
    """The numbers (_BLOCK, size) of the ticks of a block."""

    index: int
    rows: Array
