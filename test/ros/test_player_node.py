"""The player with subscribers in the same process: what they get, and when, whatever they ask for."""

from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from mcap.writer import Writer as McapWriter
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSProfile, QoSReliabilityPolicy
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosgraph_msgs.msg import Clock
from sms_handover_interfaces.srv import Seek, SetRate
from std_msgs.msg import String
from std_srvs.srv import Trigger

from sms_handover.bag.qos import Durability, History, Qos, Reliability
from sms_handover.bag.writer import BagWriter
from sms_handover.errors import BagError, ConfigurationError, GraphError
from sms_handover.graph.topics import PLAYER
from sms_handover.messages.message_types import MessageTypes
from sms_handover.nodes.parts.bag_publishers import BagPublisher, profile_for
from sms_handover.nodes.player import PlayerNode
from sms_handover.playback.qos import Offer
from sms_handover.ros.process.main import EXIT_LOSS, EXIT_OK, EXIT_STOPPED
from sms_handover.ros.qos import LATCHED, LOSSLESS

from .bench import Bench
from .script import Script, Stop

pytestmark = pytest.mark.ros

TEXT = "std_msgs/msg/String"
MS = 1_000_000  # ns
COUNT = 200
CASES = Path(__file__).resolve().parents[1] / "data" / "cases"
TYPES = MessageTypes()


def string(content: str) -> bytes:
    return TYPES.serialize(TYPES.make(TEXT, data=content))


def ticks(folder: Path, count: int = COUNT, period_ns: int = MS, start_ns: int = 7_000 * MS) -> Path:
    """Write a bag with a text per period on each of two topics, and a latched one."""
    latched = Qos(Reliability.RELIABLE, Durability.TRANSIENT_LOCAL, History.KEEP_LAST, 1)
    with BagWriter(folder) as writer:
        writer.add_topic("/odd", TEXT, (Qos(history=History.KEEP_ALL),))
        writer.add_topic("/even", TEXT, (Qos(history=History.KEEP_LAST, depth=1),))
        writer.add_topic("/map", TEXT, (latched,))
        writer.write("/map", string("map"), start_ns, 0)
        for number in range(count):
            topic = "/odd" if number % 2 else "/even"
            writer.write(topic, string(f"{number}"), start_ns + number * period_ns, 0)
    return folder


class Ears:
    """Subscribers that note every message, and where the playback was then."""

    def __init__(self, bench: Bench, *topics: str, profile: QoSProfile = LOSSLESS) -> None:
        """Listen."""
        self.heard: list[tuple[str, str]] = []
        self.raw: list[bytes] = []
        self.clock: list[int] = []
        self._bench = bench
        node = bench.plain("ears")
        for topic in topics:
            node.create_subscription(String, topic, self._taker(topic), profile, raw=True)
        node.create_subscription(Clock, "/clock", self._on_clock, LOSSLESS)

    def _taker(self, topic: str) -> Callable[[Any], None]:
        def take(data: bytes) -> None:
            self.raw.append(data)
            self.heard.append((topic, TYPES.deserialize(data, TEXT).data))

        return take

    def _on_clock(self, message: Clock) -> None:
        self.clock.append(message.clock.sec * 10**9 + message.clock.nanosec)

    def wait_for(self, count: int) -> None:
        """Wait for what has been confirmed by the middleware and still waits for the executor."""
        self._bench.until(lambda: len(self.heard) >= count, f"{count} messages")

    @property
    def texts(self) -> list[str]:
        """Return what was heard."""
        return [text for _, text in self.heard]


class Player:
    """The real node, with parameters."""

    def __init__(self, bench: Bench, recorded: Path, **parameters: object) -> None:
        """Start it."""
        given = {"bag": str(recorded), "keyboard": False, "ack_timeout": 20.0, **parameters}
        bench.start({PLAYER: given})
        self.bench = bench

    def add(self) -> PlayerNode:
        """Return the node, whose subscribers may come first."""
        self.node = self.bench.add(PlayerNode)
        return self.node

    def run(self, script: Script | None = None) -> int:
        """Play to the end, or to the end of a script; return the exit code."""
        stop: Any = Stop(script)
        return self.node.run(self.bench.executor, stop)

    def call(self, name: str, kind: Any, **values: Any) -> Generator[None, None, Any]:
        """Call a service of the player within a script."""
        client = self.bench.plain(f"client_{name}").create_client(kind, f"/player/{name}")
        while not client.service_is_ready():
            yield
        future = client.call_async(kind.Request(**values))
        while not future.done():
            yield
        return future.result()


@pytest.mark.parametrize("rate", [1.0, 10.0])
def test_every_message_comes_once_in_order_with_its_bytes(
    bench: Bench, tmp_path: Path, rate: float, capfd: pytest.CaptureFixture[str]
) -> None:
    player = Player(bench, ticks(tmp_path / "bag"), rate=rate, wait=30.0)
    ears = Ears(bench, "/odd", "/even", "/map")
    player.add()
    assert player.run() == EXIT_OK
    ears.wait_for(COUNT + 1)
    for parity, topic in enumerate(("/even", "/odd")):
        expected = [str(number) for number in range(COUNT) if number % 2 == parity]
        assert [text for name, text in ears.heard if name == topic] == expected
    assert ears.texts.count("map") == 1
    sent = sorted([string("map"), *(string(str(number)) for number in range(COUNT))])
    assert (
        sorted(data[: len(string("map")) if b"map" in data else _length(data)] for data in ears.raw) == sent
    )
    assert f"{COUNT + 1} messages sent" in capfd.readouterr().out


def _length(data: bytes) -> int:
    """Return the length without the zeros with which the wire fills up to a multiple of four bytes."""
    return 8 + int.from_bytes(data[4:8], "little")


def test_topics_times_and_names_are_chosen(bench: Bench, tmp_path: Path) -> None:
    bag = ticks(tmp_path / "bag")
    player = Player(bench, bag, topics=("odd",), start_offset=0.05, duration=0.1, wait=30.0)
    ears = Ears(bench, "/odd", "/even")
    player.add()
    assert player.run() == EXIT_OK
    ears.wait_for(50)
    assert ears.heard == [("/odd", str(number)) for number in range(51, 151, 2)]


def test_what_is_latched_is_there_for_late_comers_and_behind_an_offset(bench: Bench, tmp_path: Path) -> None:
    bag = ticks(tmp_path / "bag")
    player = Player(bench, bag, start_offset=0.1, start_paused=True)
    player.add()

    def script() -> Script:
        yield
        assert (yield from player.call("play_next", Trigger)).success
        while not late:
            late.append(Ears(bench, "/map", profile=LATCHED))
        while late[0].texts != ["map"]:
            yield

    late: list[Ears] = []
    assert player.run(script()) == EXIT_STOPPED
    assert late[0].texts == ["map"]


def test_services_pause_step_seek_and_change_the_rate(bench: Bench, tmp_path: Path) -> None:
    bag = ticks(tmp_path / "bag", count=1000)
    player = Player(bench, bag, start_paused=True, wait=30.0)
    ears = Ears(bench, "/odd", "/even", "/map")
    player.add()

    def script() -> Script:
        assert (yield from player.call("play_next", Trigger)).success
        assert (yield from player.call("play_next", Trigger)).success
        while len(ears.heard) < 2:
            yield
        assert ears.texts == ["map", "0"]
        for _ in range(20):
            yield
        assert len(ears.heard) == 2
        for rate in (-1.0, 0.0, float("nan"), float("inf"), 1e300, 5e-324):
            answer = yield from player.call("set_rate", SetRate, rate=rate)
            assert not answer.success and "must be from 1e-06 to 1e+06" in answer.message
        assert (yield from player.call("set_rate", SetRate, rate=20.0)).success
        answer = yield from player.call("seek", Seek, time=Time(sec=3))
        assert not answer.success and "must be from 7 to 7.999 s" in answer.message
        assert (yield from player.call("seek", Seek, time=Time(sec=7, nanosec=990 * MS))).success
        assert (yield from player.call("toggle_paused", Trigger)).success
        answer = yield from player.call("play_next", Trigger)
        assert not answer.success and "paused" in answer.message
        while True:
            yield

    assert player.run(script()) == EXIT_OK
    ears.wait_for(13)
    again = ["map"]  # in force at the time sought
    assert ears.texts == ["map", "0", *again, *(str(number) for number in range(990, 1000))]


def test_stop_ends_it(bench: Bench, tmp_path: Path) -> None:
    player = Player(bench, ticks(tmp_path / "bag"), start_paused=True)
    player.add()

    def script() -> Script:
        assert (yield from player.call("pause", Trigger)).success
        assert (yield from player.call("stop", Trigger)).success
        while True:
            yield

    assert player.run(script()) == EXIT_OK


def test_a_loop_plays_again_and_again(bench: Bench, tmp_path: Path) -> None:
    player = Player(bench, ticks(tmp_path / "bag", count=20), loop=True, wait=30.0, topics=("odd", "even"))
    ears = Ears(bench, "/odd", "/even")
    player.add()

    def script() -> Script:
        while len(ears.heard) < 65:
            yield

    assert player.run(script()) == EXIT_STOPPED
    odd = [text for topic, text in ears.heard if topic == "/odd"]
    assert odd[:30] == 3 * [str(number) for number in range(1, 20, 2)]


def test_a_generated_clock_never_goes_ahead_of_the_messages(bench: Bench, tmp_path: Path) -> None:
    start_ns = 7_000 * MS
    player = Player(bench, ticks(tmp_path / "bag", count=300), clock=200.0, wait=30.0)
    ears = Ears(bench, "/odd", "/even", "/map")
    player.add()
    assert player.run() == EXIT_OK
    bench.until(lambda: ears.clock[-1] == start_ns + 299 * MS, "the time of the end")
    assert ears.clock == sorted(ears.clock)
    assert start_ns <= ears.clock[0] and ears.clock[-1] == start_ns + 299 * MS
    assert len(set(ears.clock)) > 10


def unknown_types(folder: Path, *, known: bool) -> Path:
    """Write a bag with rosbags whose types are those of another project, and maybe one that everybody has."""
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg("float64 level\nstd_msgs/String name\n", "tank_msgs/msg/Tank"))
    kind = store.types["tank_msgs/msg/Tank"]
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        tank = writer.add_connection("/tank", "tank_msgs/msg/Tank", typestore=store)
        data = store.serialize_cdr(kind(level=1.0, name=store.types[TEXT]("a")), "tank_msgs/msg/Tank")
        writer.write(tank, 1_700_000_000 * 10**9, data)
        if known:
            text = writer.add_connection("/text", TEXT, typestore=store)
            for number in range(10):
                stamp = 1_700_000_000 * 10**9 + number
                writer.write(text, stamp, store.serialize_cdr(store.types[TEXT](str(number)), TEXT))
    return folder


def test_a_bag_of_another_project_is_played_but_for_types_that_are_not_here(
    bench: Bench, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    player = Player(bench, unknown_types(tmp_path / "bag", known=True), wait=30.0)
    ears = Ears(bench, "/text")
    player.add()
    told = capfd.readouterr().err
    assert "not played: /tank: message type tank_msgs/msg/Tank is not installed" in told
    assert "/text" not in told
    assert player.run() == EXIT_LOSS
    assert "1 messages of the bag were not played" in capfd.readouterr().err
    ears.wait_for(10)
    assert ears.texts == [str(number) for number in range(10)]


_TIME = "{sec: 0, nsec: 0}"
_PROFILE = (
    "- {history: keep_last, depth: %s, reliability: reliable, durability: volatile, deadline: %s, lifespan: "
    f"{_TIME}, liveliness: automatic, liveliness_lease_duration: {_TIME}, "
    "avoid_ros_namespace_conventions: false}"
)
HOSTILE = (  # name, type, QoS, and what is told of it
    ("/front-camera", TEXT, "", "must not contain characters other than alphanumerics"),
    ("~/own", TEXT, "", "must not contain characters"),
    ("", TEXT, "", "must not end with"),
    ("/new\nline", TEXT, "", r"'/new\nline'"),
    ("/path", "os/path/join", "", "not of the form PACKAGE/msg/NAME"),
    ("/relative", ".os/msg/join", "", "not of the form PACKAGE/msg/NAME"),
    ("/no_class", "std_msgs/msg/__file__", "", "is no message"),
    ("/two", "std_msgs/msg/Int32", "", "/two is published with type std_msgs/msg/String already"),
    ("/rosout", TEXT, "", "rosout"),
    ("/late", TEXT, _PROFILE % (1, f"{{sec: 1, nsec: {10**26}}}"), "/late"),
)


def hostile(path: Path) -> Path:
    """Write a bag with a message on each of the topics that cannot be played, and two that can."""
    with path.open("wb") as stream:
        writer = McapWriter(stream)
        writer.start("ros2")
        schemas: dict[str, int] = {}
        good = (("/two", TEXT, "", ""), ("old", "std_msgs/String", _PROFILE % (1, "[") + "- {bad: [", ""))
        for name, kind, qos, _ in (*good, *HOSTILE):
            schemas.setdefault(kind, writer.register_schema(kind, "ros2msg", b""))
            channel = writer.register_channel(name, "cdr", schemas[kind], {"offered_qos_profiles": qos})
            writer.add_message(channel, 7, string(name), 7)
        writer.finish()
    return path


def test_one_bad_topic_never_takes_down_the_rest(
    bench: Bench, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    renamed = ("front-camera:=/front",)
    player = Player(bench, hostile(tmp_path / "a.mcap"), wait=30.0, rename=renamed)
    ears = Ears(bench, "/two", "/old", "/front")
    player.add()
    told = capfd.readouterr().err
    assert player.run() == EXIT_LOSS
    ears.wait_for(3)
    assert sorted(ears.heard) == [("/front", "/front-camera"), ("/old", "old"), ("/two", "/two")]
    left_out = [line for line in told.splitlines() if line.startswith("not played: ")]
    for name, _, _, reason in HOSTILE[1:]:
        assert any(reason in line for line in left_out), (name, told)
    assert f"{len(left_out)} messages of the bag were not played" in capfd.readouterr().err


def test_a_topic_that_somebody_publishes_with_another_type_is_left_out(
    bench: Bench, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Discovery tells; one of the same type is no conflict."""
    player = Player(bench, ticks(tmp_path / "bag", count=10))
    user = bench.stranger("user")
    user.create_publisher(Clock, "/odd", LOSSLESS)
    user.create_publisher(String, "/even", LOSSLESS)
    ears = Ears(bench, "/even", "/map")
    player.add()
    assert player.run() == EXIT_LOSS
    ears.wait_for(6)
    told = capfd.readouterr().err
    assert "not played: /odd: /odd is published with type rosgraph_msgs/msg/Clock already" in told
    assert "5 messages of the bag were not played" in told


@pytest.mark.parametrize(
    ("case", "code", "heard"),
    [
        ("two_types_on_one_topic", EXIT_LOSS, 3),
        ("topic_name_ros_forbids", EXIT_LOSS, 3),
        ("schema_without_text", EXIT_OK, 3),
    ],
)
def test_bags_of_others(bench: Bench, case: str, code: int, heard: int) -> None:
    player = Player(bench, CASES / f"{case}.mcap", wait=30.0)
    ears = Ears(bench, "/status" if case.startswith("two") else "/chatter")
    player.add()
    assert player.run() == code
    ears.wait_for(heard)
    assert len(ears.heard) == heard


def test_if_nothing_is_left_it_says_so(bench: Bench, tmp_path: Path) -> None:
    Player(bench, unknown_types(tmp_path / "bag", known=False))
    with pytest.raises(ConfigurationError, match=r"no topic of .* can be played"):
        PlayerNode()


@pytest.mark.parametrize(
    ("parameters", "told"),
    [
        ({"topics": ("nix",)}, r"has no topic /nix; it has /even, /map, /odd"),
        ({"regex": "^/nothing"}, "no topic of .* is chosen"),
        ({"rate": 0.0}, "'rate' is 0, must be > 0"),
        ({"start_offset": 99.0}, "start offset is 99 s, must be <= 0.199 s"),
        ({"bag": "nowhere"}, "there is no bag at nowhere"),
        ({"bag": ""}, "'bag' is empty"),
        ({"qos_overrides": "nowhere.yaml"}, "cannot read nowhere.yaml"),
    ],
)
def test_wrong_input_is_refused_in_one_line(
    bench: Bench, tmp_path: Path, parameters: dict[str, object], told: str
) -> None:
    Player(bench, ticks(tmp_path / "bag"), **parameters)
    with pytest.raises(ConfigurationError, match=told):
        PlayerNode()


def test_who_is_waited_for_in_vain_is_named(bench: Bench, tmp_path: Path) -> None:
    player = Player(bench, ticks(tmp_path / "bag"), wait=0.5)
    ears = Ears(bench, "/odd", "/map")
    player.add()
    with pytest.raises(GraphError, match=r"^no subscriber of /even after 0\.5 s$"):
        player.run()
    assert ears.heard == []


def test_what_nobody_confirms_is_a_loss(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(BagPublisher, "acknowledged", lambda self, timeout: self.name != "/odd")
    player = Player(bench, ticks(tmp_path / "bag", count=10), ack_timeout=0.1)
    player.add()
    assert player.run() == EXIT_LOSS
    assert "not acknowledged by a subscriber of: /odd" in capfd.readouterr().err


def test_a_bag_that_is_damaged_further_on_is_played_up_to_there(bench: Bench, tmp_path: Path) -> None:
    bag = ticks(tmp_path / "bag", count=5000, period_ns=MS // 10)
    (file,) = bag.glob("*.mcap")
    data = bytearray(file.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 100] = bytes(100)
    file.write_bytes(bytes(data))
    player = Player(bench, bag, wait=30.0, topics=("odd", "even"), read_ahead=100)
    ears = Ears(bench, "/odd", "/even")
    player.add()
    with pytest.raises(BagError, match=r"bag_0\.mcap is damaged"):
        player.run()
    for parity, topic in enumerate(("/even", "/odd")):
        numbers = [int(text) for name, text in ears.heard if name == topic]
        assert numbers == list(range(parity, 2 * len(numbers), 2)) and len(numbers) > 50


def test_overrides_replace_what_was_recorded(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "qos.yaml"
    path.write_text("/odd: {durability: transient_local, depth: 5, history: keep_last}\n", encoding="utf-8")
    player = Player(bench, ticks(tmp_path / "bag"), qos_overrides=str(path))
    node = player.add()
    (info,) = node.get_publishers_info_by_topic("/odd")
    assert info.qos_profile.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL
    (info,) = node.get_publishers_info_by_topic("/even")
    assert info.qos_profile.durability == QoSDurabilityPolicy.VOLATILE


# A publisher alone


class FakePublisher:
    """Refuses the first messages as a full queue does, and is confirmed when the test says so."""

    topic_name = "/fake"

    def __init__(self, refusals: int = 0) -> None:
        """Refuse so many times."""
        self.refusals = refusals
        self.sent: list[bytes] = []
        self.acked = False

    def publish(self, data: bytes) -> None:
        """Refuse or keep."""
        if self.refusals:
            self.refusals -= 1
            raise rclpy_implementation.RCLError("cannot publish data")
        self.sent.append(data)

    def wait_for_all_acked(self, patience: object) -> bool:
        """Return what the test says."""
        return self.acked


def bag_publisher(bench: Bench, tmp_path: Path, fake: FakePublisher, name: str) -> BagPublisher:
    node: Any = Player(bench, ticks(tmp_path / "bag")).add()
    publisher: BagPublisher = node._bag_publishers[name, TEXT]
    publisher._publisher = fake  # type: ignore[assignment]
    return publisher


def test_a_full_queue_refuses_and_nothing_is_sent(bench: Bench, tmp_path: Path) -> None:
    fake = FakePublisher(refusals=2)
    publisher = bag_publisher(bench, tmp_path, fake, "/odd")
    assert [publisher.publish(b"a"), publisher.publish(b"a"), publisher.publish(b"a")] == [False, False, True]
    assert fake.sent == [b"a"]


def test_a_latched_topic_replaces_nothing_that_has_not_been_got(bench: Bench, tmp_path: Path) -> None:
    fake = FakePublisher()
    publisher = bag_publisher(bench, tmp_path, fake, "/map")
    assert publisher.kept == 1
    assert publisher.publish(b"a")
    assert not publisher.publish(b"b")
    fake.acked = True
    assert publisher.publish(b"b")
    assert fake.sent == [b"a", b"b"]


@pytest.mark.parametrize(
    ("offer", "count", "history", "depth"),
    [
        (Offer(history=History.KEEP_LAST, depth=1), 9, QoSHistoryPolicy.KEEP_ALL, None),
        (Offer(Reliability.BEST_EFFORT, depth=5), 9, QoSHistoryPolicy.KEEP_ALL, None),
        (
            Offer(durability=Durability.TRANSIENT_LOCAL, history=History.KEEP_LAST, depth=3),
            9,
            QoSHistoryPolicy.KEEP_LAST,
            3,
        ),
        (Offer(durability=Durability.TRANSIENT_LOCAL), 9, QoSHistoryPolicy.KEEP_LAST, 9),
        (Offer(durability=Durability.TRANSIENT_LOCAL), 10**6, QoSHistoryPolicy.KEEP_LAST, 100),
        (Offer(durability=Durability.TRANSIENT_LOCAL), 0, QoSHistoryPolicy.KEEP_LAST, 1),
    ],
)
def test_the_history_drops_nothing_and_keeps_what_is_latched(
    offer: Offer, count: int, history: QoSHistoryPolicy, depth: int | None
) -> None:
    profile = profile_for(offer, count)
    assert profile.history == history
    assert depth is None or profile.depth == depth
    reliable = offer.reliability is Reliability.RELIABLE
    assert profile.reliability == (
        QoSReliabilityPolicy.RELIABLE if reliable else QoSReliabilityPolicy.BEST_EFFORT
    )


def test_durations_and_liveliness_are_those_recorded() -> None:
    profile = profile_for(Offer(deadline_ns=5 * MS, lease_ns=7 * MS), 1)
    assert (profile.deadline.nanoseconds, profile.liveliness_lease_duration.nanoseconds) == (5 * MS, 7 * MS)
    assert profile.lifespan.nanoseconds > 10**18
