"""A switch with cables that can be bad: it carries Ethernet frames between hosts, late, twice or never.

It stands for ``tc netem``, which many kernels lack, and unlike that is seeded.
"""

import fcntl
import heapq
import os
import select
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from math import inf
from random import Random
from threading import Lock, Thread
from time import monotonic

_TUNSETIFF = 0x400454CA  # of ioctl(2), see linux/if_tun.h
_TAP_WITHOUT_HEADER = 0x0002 | 0x1000  # IFF_TAP | IFF_NO_PI
_LONGEST_FRAME = 65536  # bytes
_HEADER = 14  # bytes of an Ethernet frame that no fault touches: its addresses and its type
_QUEUE_S = 0.2  # s that a frame may wait for a slow cable before it is dropped, as a full queue does
_IDLE_S = 0.5  # s between two looks whether to end


@dataclass(frozen=True)
class Fault:
    """What a cable does to each frame, in either direction; the default is a good cable.

    ``delay`` and ``jitter`` in s; ``rate`` in bit/s; the others are probabilities. A reordered frame
    overtakes those that are delayed; a corrupt one has one bit flipped.
    """

    delay: float = 0.0
    jitter: float = 0.0
    loss: float = 0.0
    reorder: float = 0.0
    duplicate: float = 0.0
    corrupt: float = 0.0
    rate: float = inf
    cut: bool = False


@dataclass
class Cable:
    """The cable between the switch and one host; ``carried`` and ``dropped`` count its frames."""

    device: str
    handle: int
    fault: Fault = Fault()
    carried: int = 0
    dropped: int = 0
    free_at: list[float] = field(default_factory=lambda: [0.0, 0.0])  # s, per direction

    def passes(self, frame: bytes, due: float, outwards: bool, random: Random) -> list[tuple[float, bytes]]:
        """Return what comes out at the other end, each with when, of a frame that goes in at ``due``."""
        fault = self.fault
        if fault.cut or random.random() < fault.loss:
            self.dropped += 1
            return []
        if fault.rate < inf:
            begin = max(due, self.free_at[outwards])
            if begin - due > _QUEUE_S:
                self.dropped += 1
                return []
            due = self.free_at[outwards] = begin + 8 * len(frame) / fault.rate
        if random.random() >= fault.reorder:
            due += fault.delay + fault.jitter * random.random()
        if random.random() < fault.corrupt:
            frame = _with_one_bit_flipped(frame, random)
        copies = 1 + (random.random() < fault.duplicate)
        self.carried += copies
        return [(due, frame)] * copies


class Switch:
    """Carries frames between its cables, from a thread of its own until it is closed."""

    def __init__(self, seed: int) -> None:
        """Begin without cables."""
        self._random = Random(seed)
        self._cables: dict[int, Cable] = {}
        self._at: dict[bytes, Cable] = {}
        self._waiting: list[tuple[float, int, bytes, Cable]] = []
        self._number = 0
        self._lock = Lock()
        self._poll = select.poll()
        self._open = True
        self._thread = Thread(target=self._carry, daemon=True)
        self._thread.start()

    def plug(self) -> Cable:
        """Return a new cable; its ``device`` is the network device that the host is to be given."""
        handle = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
        answer = fcntl.ioctl(handle, _TUNSETIFF, struct.pack("16sH22x", b"", _TAP_WITHOUT_HEADER))
        cable = Cable(answer[:16].rstrip(b"\0").decode(), handle)
        with self._lock:
            self._cables[handle] = cable
            self._poll.register(handle, select.POLLIN)
        return cable

    def set(self, *cables: Cable, **fault: float | bool) -> None:
        """Make cables bad, or good again where no fault is given."""
        with self._lock:
            for cable in cables:
                cable.fault = replace(Fault(), **fault)  # type: ignore[arg-type]

    def close(self) -> None:
        """Carry nothing any longer."""
        self._open = False
        self._thread.join()
        for handle in self._cables:
            os.close(handle)

    def _carry(self) -> None:
        """Take frames and deliver those that are due."""
        while self._open:
            wait = self._waiting[0][0] - monotonic() if self._waiting else _IDLE_S
            ready = self._poll.poll(1000 * min(max(wait, 0.0), _IDLE_S))
            with self._lock:
                for handle, _ in ready:
                    for frame in _frames(handle):
                        self._take(frame, self._cables[handle])
                self._deliver()

    def _take(self, frame: bytes, source: Cable) -> None:
        """Put a frame on its way to one host, or to all if it is for all or for one not known."""
        to, sender = frame[:6], frame[6:12]
        self._at[sender] = source
        known = self._at.get(to)
        targets = [known] if known else [cable for cable in self._cables.values() if cable is not source]
        for due, passed in source.passes(frame, monotonic(), False, self._random):
            for target in targets:
                for at, arrived in target.passes(passed, due, True, self._random):
                    self._number += 1
                    heapq.heappush(self._waiting, (at, self._number, arrived, target))

    def _deliver(self) -> None:
        """Hand over every frame that is due."""
        now = monotonic()
        while self._waiting and self._waiting[0][0] <= now:
            _, _, frame, target = heapq.heappop(self._waiting)
            try:
                os.write(target.handle, frame)
            except OSError:  # the host is gone, or its queue is full: a frame may always be lost
                target.dropped += 1


def _frames(handle: int) -> Iterator[bytes]:
    """Yield the frames that a host has sent."""
    while True:
        try:
            yield os.read(handle, _LONGEST_FRAME)
        except (BlockingIOError, OSError):
            return


def _with_one_bit_flipped(frame: bytes, random: Random) -> bytes:
    """Return a frame with one bit of its content flipped."""
    bit = random.randrange(8 * _HEADER, 8 * len(frame))
    changed = bytearray(frame)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)
