"""The recorder, with the real nodes or made-up ones, all in one process: what the bag holds at the end."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.serialization import serialize_message
from sms_handover_interfaces.msg import PublishedCounts, RunState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from sms_handover.analysis.equality import compare_runs
from sms_handover.bag.files import read_messages
from sms_handover.bag.info import BagInfo, read_info
from sms_handover.bag.mcap.scan import FileScan, ScannedMessage
from sms_handover.bag.repair.check import check
from sms_handover.bag.run.reader import read_run
from sms_handover.errors import ConfigurationError
from sms_handover.frames import BASE, WORLD
from sms_handover.graph.topics import (
    DIAGNOSTICS,
    JOINT_STATES,
    NODES,
    PLANT,
    RECORDER,
    REFUSED_TOPIC,
    RUN_PUBLISHED,
    RUN_RECORDED,
    RUN_STATE,
    Rate,
)
from sms_handover.messages.message_types import MessageTypes
from sms_handover.messages.values import time_ns
from sms_handover.nodes.controller import ControllerNode
from sms_handover.nodes.ik import IkNode
from sms_handover.nodes.plant import PlantNode
from sms_handover.nodes.recorder import RecorderNode
from sms_handover.nodes.trajectory import TrajectoryNode
from sms_handover.ros.codecs.loop_messages import JointStateCodec
from sms_handover.ros.node.endpoints import Endpoints
from sms_handover.ros.process.main import EXIT_LOSS, EXIT_OK, EXIT_STOPPED
from sms_handover.ros.qos import LATCHED, LOSSLESS
from sms_handover.simulation.parameters import DIRECT, EXECUTOR, TRANSPORTS
from sms_handover.simulation.scenario import Overrides, load_scenario
from sms_handover.simulation.simulate import simulate

from .bench import Bench
from .graph import TOPICS
from .short_handover import END_S, short_handover

pytestmark = pytest.mark.ros

TICKS = round(END_S * 1000) + 1
PERIODS = (TICKS - 1) // 20 + 1


class Stop:
    """Asks the recorder to stop when a condition holds."""

    def __init__(self, condition: Callable[[], bool] = lambda: False) -> None:
        """Take the condition."""
        self._condition = condition

    @property
    def asked(self) -> bool:
        """Whether to stop."""
        return self._condition()


class Recorded:
    """The whole graph in one process with the real recorder."""

    def __init__(self, bench: Bench, overrides: Overrides | None = None, **recorder: object) -> None:
        """Start every node."""
        self.folder = bench.folder / "bag"
        schedule = bench.folder / "schedule.yaml"
        schedule.write_text(short_handover(), encoding="utf-8")
        overrides = dict(overrides or {})
        overrides["common"] = {
            "schedule": str(schedule),
            "peers": NODES,
            "transport": EXECUTOR,
            **overrides.get("common", {}),
        }
        self.overrides: Overrides = overrides
        bench.start({**overrides, RECORDER: {"folder": str(self.folder), "transport": DIRECT, **recorder}})
        self.bench = bench
        self.plant = bench.add(PlantNode)
        for make in (TrajectoryNode, IkNode, ControllerNode):
            bench.add(make)
        self.recorder = bench.add(RecorderNode)

    def run(self, condition: Callable[[], bool] = lambda: False) -> int:
        """Record to the end, or until a condition holds; return the recorder's exit code."""
        stop: Any = Stop(condition)
        return self.recorder.run(self.bench.executor, stop)

    @property
    def info(self) -> BagInfo:
        """Return what the bag says of itself."""
        return read_info(self.folder)


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_bag_is_the_simulated_run_bit_for_bit(bench: Bench, transport: str) -> None:
    """Here the recorder has the transport, the others take what they get by the executor."""
    overrides: Overrides = {
        "controller": {"law": "pid"},
        "trajectory": {"time_law": "quintic"},
    }
    recorded = Recorded(bench, overrides, transport=transport)
    assert recorded.run() == EXIT_OK
    run = read_run(recorded.folder)
    assert len(run.tick_ns) == TICKS and len(run.grasp_events) == 2
    assert compare_runs(run, simulate(load_scenario(values=recorded.overrides))) == ()


def test_bag_stands_on_its_own(bench: Bench) -> None:
    recorded = Recorded(bench)
    assert recorded.run() == EXIT_OK
    info = recorded.info
    assert info.schedule_text == short_handover()
    assert info.urdf_text == recorded.plant.robot.urdf
    assert set(info.parameters) == set(NODES)
    for name in NODES:
        assert info.parameters[name]["tick"] == 0.001
        assert info.parameters[name]["peers"] == list(NODES)
    assert info.parameters["controller"]["law"] == "nmpc"
    assert info.parameters["recorder"]["folder"] == str(recorded.folder)
    assert {"start", "git_revision", "seed", "python", "platform"} <= set(info.provenance)
    assert all(text for text in info.provenance.values())


def test_every_topic_of_the_graph_is_there_with_every_message(bench: Bench) -> None:
    recorded = Recorded(bench)
    assert recorded.run() == EXIT_OK
    info = recorded.info
    counts = {Rate.TICK: TICKS, Rate.REFERENCE: PERIODS, Rate.CLOCK: (TICKS - 1) // 10 + 1}
    for topic in TOPICS:
        if topic.is_from_outside:
            continue  # what the plant makes of it is recorded
        found = info.topics[topic.name if topic.name.startswith("/") else f"/{topic.name}"]
        assert (found.type, found.encoding, found.schema_encoding) == (topic.type, "cdr", "ros2msg")
        assert found.type_hash.startswith("RIHS01_")
        (qos,) = yaml.safe_load(found.qos)
        assert qos["durability"] == ("transient_local" if topic.latched else "volatile")
        if topic.rate in counts:
            assert found.message_count == counts[topic.rate] * len(topic.publishers), topic.name
    assert info.topics["/task/grasp_event"].message_count == 2
    assert info.topics["/run/published"].message_count == 4
    ledger = info.ledger
    assert ledger is not None and ledger.complete
    for account in ledger.topics:
        assert account.missing == account.duplicates == account.out_of_order == 0 or account.period_ns == 0
    by_name = {account.name: account for account in ledger.topics}
    for name in ("/joint_states", "/joint_command", "/base_odometry"):
        assert by_name[name].published == by_name[name].received == TICKS


def test_transforms_are_those_of_the_run(bench: Bench) -> None:
    recorded = Recorded(bench)
    recorded.run()
    run = read_run(recorded.folder)
    types = MessageTypes()
    by_period: dict[int, dict[str, Any]] = {}
    for recorded_message in read_messages(recorded.folder, ("/tf",)):
        transforms = types.deserialize(recorded_message.data, recorded_message.type).transforms
        assert {time_ns(item.header.stamp) for item in transforms} == {recorded_message.log_time_ns}
        by_child = by_period.setdefault(recorded_message.log_time_ns, {})
        by_child.update((item.child_frame_id, item) for item in transforms)
    assert len(by_period) == PERIODS
    for row, by_child in enumerate(by_period.values()):
        base, deputy = by_child[BASE], by_child["deputy"]
        assert base.header.frame_id == deputy.header.frame_id == WORLD
        place = base.transform.translation
        assert (place.x, place.y, place.z) == tuple(run.base_pose[20 * row, :3])
        place = deputy.transform.translation
        assert (place.x, place.y, place.z) == tuple(run.deputy_pose[row, :3])


@pytest.mark.parametrize("profile", [LATCHED, LOSSLESS])
def test_topics_beyond_the_graph_are_recorded(bench: Bench, profile: Any) -> None:
    recorded = Recorded(bench)
    user = bench.plain("user")
    publisher = user.create_publisher(String, "notes", profile)
    bench.until(lambda: publisher.get_subscription_count() == 1, "the recorder to find the topic")

    def heard() -> bool:
        publisher.publish(String(data="a note"))
        return recorded.recorder.counts.get("/notes", 0) >= 3

    bench.until(heard, "the notes")
    assert recorded.run() == EXIT_OK
    notes = recorded.info.topics["/notes"]
    assert notes.type == "std_msgs/msg/String"
    assert notes.message_count >= 3
    (qos,) = yaml.safe_load(notes.qos)
    assert qos["durability"] == ("transient_local" if profile is LATCHED else "volatile")


def test_only_the_graph_is_recorded_if_wanted(bench: Bench) -> None:
    recorded = Recorded(bench, record_all=False)
    bench.plain("user").create_publisher(String, "notes", LATCHED).publish(String(data="a note"))
    assert recorded.run() == EXIT_OK
    recorded_ones = (topic.name for topic in TOPICS if not topic.is_from_outside)
    graph = {name if name.startswith("/") else f"/{name}" for name in recorded_ones}
    assert set(recorded.info.topics) == graph


def test_asked_to_stop_it_stops_and_the_bag_is_whole(bench: Bench) -> None:
    """The graph goes on; that must not keep the recorder from its end."""
    recorded = Recorded(bench, {"common": {"schedule": ""}})
    code = recorded.run(lambda: recorded.recorder.report().stamp_ns >= 100_000_000)
    assert not recorded.plant.finished
    assert recorded.plant.report().stamp_ns < 59_000_000_000
    assert code == EXIT_STOPPED
    run = read_run(recorded.folder)
    assert len(run.tick_ns) >= 100
    assert run.tick_ns.tolist() == [k * 1_000_000 for k in range(len(run.tick_ns))]
    assert set(recorded.info.parameters) == set(NODES)
    ledger = recorded.info.ledger
    assert ledger is not None and ledger.complete


def test_an_error_leaves_a_whole_bag(bench: Bench) -> None:
    recorded = Recorded(bench)

    def fail_later() -> bool:
        if recorded.recorder.report().stamp_ns >= 50_000_000:
            raise RuntimeError("as a bug would")
        return False

    with pytest.raises(RuntimeError, match="as a bug would"):
        recorded.run(fail_later)
    assert len(read_run(recorded.folder).tick_ns) >= 50


def test_every_run_has_a_bag_of_its_own(bench: Bench) -> None:
    """A reset closes the bag of the run before, whole, and opens another for the next run."""
    recorded = Recorded(bench)
    client = bench.plain("client").create_client(Trigger, f"{PLANT}/reset")
    asked: list[Any] = []

    def reset_once() -> bool:
        if not asked and recorded.plant.report().stamp_ns >= 150_000_000 and client.service_is_ready():
            asked.append(client.call_async(Trigger.Request()))
        return False

    assert recorded.run(reset_once) == EXIT_OK
    assert asked
    whole = simulate(load_scenario(values=recorded.overrides))
    first = read_run(recorded.folder)
    assert 150 < len(first.tick_ns) < TICKS
    assert np.array_equal(first.joint_position, whole.joint_position[: len(first.tick_ns)])
    second = recorded.folder.with_name("bag_2")
    assert compare_runs(read_run(second), whole) == ()
    for bag in (recorded.folder, second):
        info = read_info(bag)
        assert info.ledger is not None and info.ledger.complete
        assert info.parameters.keys() == {*NODES} and info.urdf_text and info.schedule_text
        result = check(bag)
        assert result.complete, result.findings


# A recorder alone with a made-up plant


class FakePlant:
    """Publishes joint states of some stamps, says how many there were, and goes on with diagnostics."""

    def __init__(self, node: Node) -> None:
        """Prepare."""
        self._endpoints = Endpoints(node, TOPICS, (PLANT, RECORDER))
        self._state = self._endpoints.publisher(JOINT_STATES)
        self._run_state = self._endpoints.publisher(RUN_STATE)
        self._counts = self._endpoints.publisher(RUN_PUBLISHED)
        diagnostics = self._endpoints.publisher(DIAGNOSTICS)
        node.create_timer(0.05, lambda: diagnostics.publish(DiagnosticArray()))  # s, well below drain_timeout
        self.recorded: list[int] = []  # stamps in ns up to which the recorder says it has everything
        self._endpoints.subscribe(RUN_RECORDED, lambda m: self.recorded.append(time_ns(m.stamp)))
        self._codec = JointStateCodec(("joint",), ("position",))

    def matched(self) -> bool:
        """Whether the recorder listens."""
        return not self._endpoints.unmatched

    def publish(self, ticks: Iterable[int]) -> None:
        """Publish the states of ticks."""
        for tick in ticks:
            self._state.publish(self._codec.pack(tick * 1_000_000, position=np.ones(1)))

    def run(self, ticks: list[int], told: int) -> None:
        """Publish a whole run, and tell a count."""
        self.publish(ticks)
        self._run_state.publish(RunState(state=RunState.FINISHED))
        self._counts.publish(PublishedCounts(node=PLANT, topics=["/joint_states"], counts=[told]))


@pytest.fixture
def lone(bench: Bench) -> tuple[RecorderNode, FakePlant]:
    """A recorder and a made-up plant that have found each other."""
    common = {"peers": (PLANT, RECORDER)}
    folder = bench.folder / "bag"
    bench.start({"common": common, RECORDER: {"folder": str(folder), "drain_timeout": 0.3}})
    plant = FakePlant(bench.plain(PLANT))
    recorder = bench.add(RecorderNode)
    subscription = recorder.endpoints
    bench.until(
        lambda: (
            plant.matched() and not any("publishers of joint_states" in t for t in subscription.unmatched)
        ),
        "the match",
    )
    return recorder, plant


@pytest.mark.parametrize(
    ("ticks", "told", "code", "missing"),
    [
        ([0, 1, 2, 3], 4, EXIT_OK, 0),
        ([0, 1, 3], 3, EXIT_LOSS, 1),
        ([0, 1, 2], 5, EXIT_LOSS, 0),
        ([0, 2, 1, 3], 4, EXIT_OK, 0),
    ],
)
def test_what_is_missing_is_counted_and_told(
    bench: Bench,
    lone: tuple[RecorderNode, FakePlant],
    capsys: pytest.CaptureFixture[str],
    ticks: list[int],
    told: int,
    code: int,
    missing: int,
) -> None:
    recorder, plant = lone
    plant.run(ticks, told)
    never: Any = Stop()
    assert recorder.run(bench.executor, never) == code
    ledger = read_info(bench.folder / "bag").ledger
    assert ledger is not None
    account = next(account for account in ledger.topics if account.name == "/joint_states")
    assert (account.received, account.published, account.missing) == (len(ticks), told, missing)
    assert ledger.complete is (code == EXIT_OK)
    (row,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith("/joint_states"))
    assert row.split()[1:4] == [str(len(ticks)), str(told), str(missing)]


@pytest.mark.parametrize(("length", "apart"), [(None, 0), (12, 1)], ids=["whole", "cut short"])
def test_what_is_malformed_from_one_not_yet_known_is_recorded_apart(
    bench: Bench,
    lone: tuple[RecorderNode, FakePlant],
    monkeypatch: pytest.MonkeyPatch,
    length: int | None,
    apart: int,
) -> None:
    """Whoever is not discovered yet may be a node of the run; what does not decode would spoil the topic."""
    recorder, plant = lone
    discovered = recorder.get_publishers_info_by_topic
    monkeypatch.setattr(
        recorder,
        "get_publishers_info_by_topic",
        lambda topic: [there for there in discovered(topic) if there.node_name != "intruder"],
    )
    publisher = bench.plain("intruder").create_publisher(PublishedCounts, RUN_PUBLISHED, LATCHED)
    bench.until(publisher.get_subscription_count, "the match of the intruder")
    counts = PublishedCounts(node="nobody", topics=["/nothing"], counts=[1])
    publisher.publish(serialize_message(counts)[:length])
    plant.run([0, 1, 2, 3], 4)
    never: Any = Stop()
    assert recorder.run(bench.executor, never) == EXIT_OK
    topics = read_info(bench.folder / "bag").topics
    assert topics["/run/published"].message_count == 2 - apart
    assert (f"/run/published{REFUSED_TOPIC}" in topics) is bool(apart)
    found = check(bench.folder / "bag").findings
    assert not [finding for finding in found if finding.text.startswith("/run/published cannot be decoded")]


def test_a_folder_that_exists_is_refused(bench: Bench, tmp_path: Path) -> None:
    folder = tmp_path / "there"
    folder.mkdir()
    (folder / "mine").write_text("keep", encoding="utf-8")
    bench.start({RECORDER: {"folder": str(folder)}})
    with pytest.raises(ConfigurationError, match="there"):
        bench.add(RecorderNode)
    assert [path.name for path in folder.iterdir()] == ["mine"]


def test_a_second_recorder_on_the_folder_is_refused(bench: Bench, tmp_path: Path) -> None:
    bench.start({RECORDER: {"folder": str(tmp_path / "bag")}})
    bench.add(RecorderNode)
    with pytest.raises(ConfigurationError, match="exists"):
        bench.add(RecorderNode)


def test_a_folder_that_cannot_be_made_is_refused(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    bench.start({RECORDER: {"folder": str(tmp_path / "file" / "bag")}})
    with pytest.raises(ConfigurationError, match="file"):
        bench.add(RecorderNode)


def test_what_it_says_is_recorded_is_in_the_file(bench: Bench, lone: tuple[RecorderNode, FakePlant]) -> None:
    """The file as it is at that moment is what a kill would leave."""
    recorder, plant = lone
    file = bench.folder / "bag" / "bag_0.mcap"
    ticks = list(range(0, 201, 4))

    def told_all() -> bool:
        heard = plant.recorded[-1] if plant.recorded else -1
        there = [item.log_time_ns for item in FileScan(file) if isinstance(item, ScannedMessage)]
        assert max(there, default=-1) >= heard
        if ticks:
            plant.publish([ticks.pop(0)])
        return heard == 200_000_000

    stop: Any = Stop(told_all)
    assert recorder.run(bench.executor, stop) == EXIT_STOPPED
    assert plant.recorded == sorted(plant.recorded)
    assert len(plant.recorded) > 2
