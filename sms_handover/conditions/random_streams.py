"""Random streams: one for each model, which no other model, law, worker or wall clock moves."""

from collections.abc import Iterable, Iterator
from hashlib import sha256

import numpy as np

from sms_handover.types import Array, frozen

_DIGEST_BYTES = 16  # of the name of a model: no two names share a stream
_BLOCK = 1024  # [ticks] drawn at once: a draw of few numbers costs a call as well
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
        self._block = -1
        self._normal = self._uniform = frozen(np.empty((0, size)))

    def normal(self, tick: int) -> Array:
        """Return the standard normal numbers (size,) of a tick."""
        self._draw(tick)
        row: Array = self._normal[tick % _BLOCK]
        return row

    def uniform(self, tick: int) -> Array:
        """Return the numbers (size,) in [0, 1) of a tick."""
        self._draw(tick)
        row: Array = self._uniform[tick % _BLOCK]
        return row

    def normals(self, first: int, ticks: int) -> Array:
        """Return the standard normal numbers (ticks, size) of ticks from a first one on."""
        return self._joined(self._normal[rows] for rows in self._blocks(first, ticks))

    def uniforms(self, first: int, ticks: int) -> Array:
        """Return the numbers (ticks, size) in [0, 1) of ticks from a first one on."""
        return self._joined(self._uniform[rows] for rows in self._blocks(first, ticks))

    def _joined(self, parts: Iterable[Array]) -> Array:
        """Return the rows of some blocks as one array."""
        return np.concatenate([np.empty((0, self._size)), *parts])

    def _blocks(self, first: int, ticks: int) -> Iterator[slice]:
        """Draw the blocks of some ticks one after the other, and yield which rows of each are theirs."""
        tick, end = first, first + ticks
        while tick < end:
            self._draw(tick)
            start = tick % _BLOCK
            stop = min(_BLOCK, start + end - tick)
            yield slice(start, stop)
            tick += stop - start

    def _draw(self, tick: int) -> None:
        """Draw the block of a tick, unless it is there."""
        block = tick // _BLOCK
        if block == self._block:
            return
        bits = np.random.Philox(self._sequence)
        bits.advance(block * _COUNTER)
        generator = np.random.Generator(bits)
        self._uniform = frozen(generator.random((_BLOCK, self._size)))  # first: it takes a known number
        self._normal = frozen(generator.standard_normal((_BLOCK, self._size)))
        self._block = block
