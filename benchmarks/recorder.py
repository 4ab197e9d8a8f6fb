"""Cost of recording per message, compared with the writer of mcap alone."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
from mcap.writer import CompressionType, Writer

from benchmarks.ping_pong import NAMES
from benchmarks.results import Result, Table, publish, row
from sms_handover.bag.files import read_messages
from sms_handover.bag.recording import Recording
from sms_handover.bag.writer import CHUNK_SIZE
from sms_handover.graph.topics import TF, graph_topics
from sms_handover.messages.message_types import MessageTypes
from sms_handover.ros.codecs.loop_messages import JointStateCodec

COUNT = 60_000  # messages, as of one topic of a whole run
ROUNDS = 5
TOPICS = (1, 10, 100)
BARE = "mcap.writer.Writer, one topic"
_TICK_NS = 1_000_000
_TYPE = "sensor_msgs/msg/JointState"


def messages() -> list[bytes]:
    """Return the joint states of a run in which every joint moves."""
    codec, random = JointStateCodec(NAMES, ("position", "velocity", "effort")), np.random.default_rng(1)
    blocks = random.normal(size=(3, COUNT, len(NAMES)))
    return [
        codec.pack(k * _TICK_NS, position=blocks[0, k], velocity=blocks[1, k], effort=blocks[2, k])
        for k in range(COUNT)
    ]


def bare(path: Path, data: list[bytes]) -> None:
    """Write with mcap alone, with the chunks and the compression of our recordings."""
    schema = MessageTypes().schema(_TYPE)
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=CHUNK_SIZE, compression=CompressionType.ZSTD)
        writer.start(profile="ros2")
        channel = writer.register_channel(
            "/joint_states", "cdr", writer.register_schema(_TYPE, "ros2msg", schema.text.encode())
        )
        for k, message in enumerate(data):
            writer.add_message(channel, k * _TICK_NS, message, k * _TICK_NS)
        writer.finish()  # type: ignore[no-untyped-call]


def recorded(path: Path, data: list[bytes], topics: int) -> None:
    """Record as the recorder node does: stamps read, losses booked, nothing held back longer than 20 ms.

    Each tick brings a message of every topic; there are as many messages in all, whatever their number.
    """
    names = [f"/joint_states_{number}" for number in range(topics)]
    with Recording(path) as recording:
        for name in names:
            recording.add_topic(name, _TYPE, (), _TICK_NS)
        for message in data[: COUNT // topics]:
            for name in names:
                recording.receive(name, message, 0)
    assert recording.ledger.complete


def cpu(write: Callable[[], None]) -> float:
    """Return the CPU time in s per message."""
    start = process_time()
    write()
    return (process_time() - start) / COUNT


def main() -> None:
    """Measure and publish."""
    data = messages()
    ours = {f"our recording, topics: {topics}": topics for topics in TOPICS}
    times: dict[str, list[float]] = {name: [] for name in (BARE, *ours)}
    with TemporaryDirectory() as folder:
        for number in range(ROUNDS):
            times[BARE].append(cpu(partial(bare, Path(folder) / f"{number}.mcap", data)))
            for name, topics in ours.items():
                bag = Path(folder) / f"{number}_{topics}"
                times[name].append(cpu(partial(recorded, bag, data, topics)))
                assert sum(1 for _ in read_messages(bag)) == COUNT
    least = min(times[BARE])
    rows = [row(n, 1e6 * min(each), 1.0 / min(each), min(each) / least) for n, each in times.items()]
    in_graph = len(graph_topics(("arm_a", "arm_b"))) + 1
    publish(
        Result(
            name="recorder",
            question="What does recording cost?",
            notes=[
                f"{COUNT} JointState messages of {len(data[0])} bytes, the least CPU time of {ROUNDS} "
                f"rounds in turn. The bag of the graph has {in_graph} topics, {TF} among them."
            ],
            tables=[Table(("writer", "CPU per message [us]", "messages/s", "times the bare one"), rows)],
        )
    )


if __name__ == "__main__":
    main()
