"""A loop spins where that pays off, gives way to others, and takes what it awaits before anything else."""

import os
from time import monotonic

import pytest
from rclpy.node import Node
from std_msgs.msg import String

from sms_handover.graph.topics import CONTROLLER, IK, NODES, PLANT, RECORDER, TRAJECTORY
from sms_handover.ros.qos import LOSSLESS
from sms_handover.ros.transport import spinning
from sms_handover.ros.transport.direct import DirectInputs
from sms_handover.ros.transport.spinning import AdaptiveSpin, spin_of
from sms_handover.simulation.scenario import load_scenario

from .bench import Bench

pytestmark = pytest.mark.ros


class Clock:
    """Stands for the clock and the scheduler: each look at the time takes 1 ms."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now, self.yields = 0.0, 0
        monkeypatch.setattr(spinning, "monotonic", self.look)
        monkeypatch.setattr(os, "sched_yield", self.give_way)

    def look(self) -> float:
        self.now += 0.001
        return self.now

    def give_way(self) -> None:
        self.yields += 1


def test_it_gives_way_between_any_two_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, looks = Clock(monkeypatch), list[int]()
    assert not AdaptiveSpin(0.0105).find(lambda: bool(looks.append(clock.yields)))  # type: ignore[func-returns-value]
    assert looks == list(range(10)) and clock.yields == 10


def test_it_stops_after_misses_and_tries_again_later(monkeypatch: pytest.MonkeyPatch) -> None:
    Clock(monkeypatch)
    spin, looked = AdaptiveSpin(0.002), list[int]()
    found = [spin.find(lambda n=n: bool(looked.append(n))) for n in range(210)]  # type: ignore[misc,func-returns-value]
    assert not any(found)
    assert sorted(set(looked)) == [0, 1, 2, *range(203, 206)]
    assert AdaptiveSpin(0.002).find(lambda: True)


def test_it_does_not_look_for_what_others_have_to_work_for_first() -> None:
    near, looked = [False], list[int]()
    spin = AdaptiveSpin(1.0, lambda: near[0])
    assert not spin.find(lambda: bool(looked.append(1))) and not looked  # type: ignore[func-returns-value]
    near[0] = True
    assert spin.find(lambda: True)


def test_what_comes_keeps_it_going(monkeypatch: pytest.MonkeyPatch) -> None:
    Clock(monkeypatch)
    spin = AdaptiveSpin(0.002)
    for _ in range(50):
        assert not spin.find(lambda: False) and not spin.find(lambda: False)
        assert spin.find(lambda: True)


def test_only_plant_and_controller_spin_with_a_processor_each(monkeypatch: pytest.MonkeyPatch) -> None:
    def spinning_nodes(processors: int, *peers: str, **values: object) -> set[str]:
        monkeypatch.setattr(os, "sched_getaffinity", lambda pid: set(range(processors)))
        common = load_scenario(values={"common": {"peers": peers, **values}}).parameters.common
        return {node for node in NODES if spin_of(node, common, lambda: True) is not None}

    loop, both = (PLANT, TRAJECTORY, IK, CONTROLLER), {PLANT, CONTROLLER}
    assert spinning_nodes(2, *loop) == spinning_nodes(3, *loop, RECORDER) == both
    assert spinning_nodes(1, *loop) == spinning_nodes(2, *loop, RECORDER) == set()
    assert spinning_nodes(4, *loop, spin=0.0) == spinning_nodes(4, *loop, mode="realtime") == set()


@pytest.mark.parametrize("spins", [False, True])
def test_what_is_awaited_is_handed_over_first(bench: Bench, spins: bool) -> None:
    """It came last, and its topic was subscribed last."""
    bench.start()
    node = bench.loose("listener")
    inputs, heard = DirectInputs(node), list[str]()
    inputs.spin = AdaptiveSpin(0.01) if spins else None
    publishers = {}
    speaker: Node = bench.loose("speaker")
    for name in ("other", "awaited"):
        publishers[name] = speaker.create_publisher(String, name, LOSSLESS)
        inputs.subscribe(String, name, LOSSLESS, lambda data, sent_ns, sender, n=name: heard.append(n))  # type: ignore[misc]
    bench.until(lambda: all(p.get_subscription_count() for p in publishers.values()), "the subscriptions")
    inputs.awaited = lambda: "awaited"
    inputs._hot_until = monotonic() + 10.0
    source = inputs._sources["awaited"]
    for name, publisher in publishers.items():
        publisher.publish(String(data=name))
    assert inputs._take_first(source, monotonic() + (0.05 if spins else 10.0))
    assert heard == ["awaited"] and inputs.wakes == 1
    inputs.poll()
    assert heard == ["awaited", "other"]
    inputs.destroy()
