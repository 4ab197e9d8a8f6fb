"""The work of the plant node in one tick, counted in calls and in memory kept, not in time."""

import gc
import sys
from types import FrameType

import numpy as np
import pytest

from sms_handover.graph.topics import JOINT_COMMAND, PLANT, TASK_PHASE
from sms_handover.nodes.plant import PlantNode
from sms_handover.ros.codecs.loop_messages import JointStateCodec
from sms_handover.ros.codecs.task_phase import PhaseCodec
from sms_handover.types import TaskPhase

from .bench import Bench
from .short_handover import short_handover

pytestmark = pytest.mark.ros

TICK_NS = 1_000_000
PER_PERIOD = 20  # ticks
FIRST, LAST = 201, 219  # the ticks counted: none of them begins a reference period or has a /clock message
QUIET = [tick for tick in range(FIRST, LAST + 1) if tick % 10 not in (0, 9)]  # nor does the one that follows
MOST_CALLS = 150  # [-] of Python and C functions in a tick
MOST_KEPT = 0.5  # [-] blocks of memory kept per tick


class Calls:
    """Counts calls while it is the profiler."""

    def __init__(self) -> None:
        """Begin with none."""
        self.count = 0

    def __call__(self, frame: FrameType, event: str, argument: object) -> None:
        """Count."""
        self.count += event in ("call", "c_call")


class Loop:
    """A plant without peers, answered by hand."""

    def __init__(self, bench: Bench) -> None:
        """Begin the run."""
        path = bench.folder / "schedule.yaml"
        path.write_text(short_handover(stretch=10.0), encoding="utf-8")
        bench.start({"common": {"peers": (PLANT,), "schedule": str(path)}})
        self.plant = bench.add(PlantNode)
        names = self.plant.robot.joint_names
        self._command, self._phase = JointStateCodec(names, ("effort",)), PhaseCodec()
        bench.until(lambda: self.plant.endpoints.counts["/joint_states"] == 1, "the begin of the run")

    def answer(self, tick: int) -> None:
        """Answer the state of a tick."""
        if tick % PER_PERIOD == 0:
            phase = self._phase.pack(TaskPhase(tick * TICK_NS, 0, "approach"))
            self.plant._on_input(TASK_PHASE, self._phase.checked(phase), 0)
        command = self._command.pack(tick * TICK_NS, effort=np.zeros(14))
        self.plant._on_input(JOINT_COMMAND, self._command.checked(command), 0)
        assert self.plant._plant.stamp_ns == (tick + 1) * TICK_NS


@pytest.fixture
def loop(bench: Bench) -> Loop:
    loop = Loop(bench)
    for tick in range(FIRST):
        loop.answer(tick)
    return loop


def test_a_tick_calls_few_functions(loop: Loop) -> None:
    """The same number in every tick, so that one call more shows."""
    counted = {}
    for tick in range(FIRST, LAST + 1):
        calls = Calls()
        sys.setprofile(calls)
        try:
            loop.answer(tick)
        finally:
            sys.setprofile(None)
        counted[tick] = calls.count
    assert len({counted[tick] for tick in QUIET}) == 1, counted
    assert counted[QUIET[0]] <= MOST_CALLS


def test_a_tick_keeps_no_memory(loop: Loop) -> None:
    kept = {}
    gc.collect()
    gc.disable()
    try:
        loop.answer(FIRST)  # what a collection has given back is taken again
        for tick in range(FIRST + 1, LAST + 1):
            before = sys.getallocatedblocks()
            loop.answer(tick)
            kept[tick] = sys.getallocatedblocks() - before
    finally:
        gc.enable()
    assert sum(kept[tick] for tick in QUIET[1:]) <= MOST_KEPT * len(QUIET), kept
