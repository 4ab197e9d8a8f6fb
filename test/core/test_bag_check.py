"""A check says what is wrong with a bag, and nothing is wrong with a good one."""

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.writer import CompressionType, IndexType, Writer

from sms_handover.bag.metadata import (
    LARGEST_METADATA,
    ROSBAG2_KEY,
    FileSpan,
    bag_information,
    metadata_of,
    to_yaml,
)
from sms_handover.bag.recording import Recording
from sms_handover.bag.repair.check import check
from sms_handover.bag.repair.findings import CheckResult, Severity
from sms_handover.bag.repair.recover import recover
from sms_handover.configuration.yaml_reader import LARGEST_FILE
from sms_handover.errors import BagError
from sms_handover.graph.topics import LOOP_NODES

from .bag_damage import STRING, chunks_of, write_file
from .bag_messages import (
    OURS,
    TYPES,
    header,
    joint_state,
    made_up_run,
    open_topics,
    published_counts,
    record_run,
    text,
)

TICKS = 201


def write_finished(
    folder: Path,
    *,
    finished: bool = True,
    failed: bool = False,
    skipped: int = 0,
    published: int = TICKS,
    refused: Sequence[tuple[str, str, bytes]] = (),
) -> Path:
    """Write a bag of a run that has ended, of which the recorder has missed some states.

    ``refused`` are messages of strangers: topic, type and bytes.
    """
    run = made_up_run(TICKS)
    run = replace(run, ik_status=np.zeros_like(run.ik_status))  # a message each reference period
    with Recording(folder, types=TYPES) as recording:
        open_topics(recording)
        recording.begin()
        receive = recording.receive
        missed = {int(stamp) for stamp in run.tick_ns[50 : 50 + skipped]}

        def lossy(topic: str, data: bytes, wall_ns: int) -> None:
            if topic != "/joint_states" or int.from_bytes(data[8:12], "little") not in missed:
                receive(topic, data, wall_ns)

        recording.receive = lossy  # type: ignore[method-assign]
        record_run(recording, run)
        for topic in {topic: kind for topic, kind, _ in refused}.items():
            recording.add_topic(*topic)
        for topic_name, _, data in refused:
            receive(topic_name, data, 0)
        if finished:
            state = TYPES.make(
                f"{OURS}/RunState",
                header=header(int(run.tick_ns[-1])),
                state=4 if failed else 3,
                tick=200,
                wall_time=0.1,
                detail="done",
            )
            receive("/run/state", TYPES.serialize(state), 0)
            for node in LOOP_NODES:
                counts = {"/joint_states": published} if node == "plant" else {}
                receive("/run/published", TYPES.serialize(published_counts(node, counts)), 0)
    return folder


def texts(result: CheckResult, severity: Severity) -> list[str]:
    return [finding.text for finding in result.findings if finding.severity is severity]


def test_a_finished_run_is_complete(tmp_path: Path) -> None:
    result = check(write_finished(tmp_path / "bag"))
    assert result.complete and result.is_ours and not result.damaged, result.findings
    assert result.counts["/joint_states"] == TICKS
    assert "the run ended at 0.2 s: done" in texts(result, Severity.NOTE)


def test_a_run_that_has_failed_is_complete_too(tmp_path: Path) -> None:
    """A task that was given up ends the run in an orderly way: nothing is missing of it."""
    result = check(write_finished(tmp_path / "bag", failed=True))
    assert result.complete, result.findings
    assert "the run failed at 0.2 s: done" in texts(result, Severity.NOTE)


def test_what_strangers_sent_makes_no_bag_incomplete(tmp_path: Path) -> None:
    """It is in a topic of its own, in whatever state and order, and counted."""
    joints, kind = TYPES.serialize(joint_state(5)), "sensor_msgs/msg/JointState"
    bad = [joints[: len(joints) // 2], joints, TYPES.serialize(joint_state(3)), joints + bytes(100_000), b""]
    refused = [("/joint_command/refused", kind, data) for data in bad]
    counts = TYPES.serialize(published_counts("plant", {"/joint_states": 10**9}))
    refused.append(("/run/published/refused", f"{OURS}/PublishedCounts", counts))
    bag = write_finished(tmp_path / "bag", refused=refused)
    result = check(bag)
    assert result.complete, result.findings
    note = "/joint_command/refused: 5 messages of other publishers than the topic's own"
    assert note in texts(result, Severity.NOTE)
    assert recover(bag, tmp_path / "again") and check(tmp_path / "again").complete


def test_what_strangers_sent_makes_no_bag_complete_either(tmp_path: Path) -> None:
    over = TYPES.make(f"{OURS}/RunState", header=header(0), state=3, tick=0, wall_time=0.0, detail="")
    refused = [("/run/state/refused", f"{OURS}/RunState", TYPES.serialize(over))]
    result = check(write_finished(tmp_path / "bag", finished=False, refused=refused))
    assert texts(result, Severity.MISSING) == ["the run was not finished when the recording ended, at 0.2 s"]


def test_a_message_of_ours_that_cannot_be_decoded_makes_the_run_incomplete(tmp_path: Path) -> None:
    """The name alone makes no topic one of refused messages: a run of ours must have it."""
    kind = "sensor_msgs/msg/JointState"
    result = check(write_finished(tmp_path / "bag", refused=[("/joint_command/other", kind, b"\0\1\0\0")]))
    (missing,) = texts(result, Severity.MISSING)
    assert missing.startswith("/joint_command/other cannot be decoded: ") and not result.damaged


def test_counts_that_cannot_be_decoded_count_nothing(tmp_path: Path) -> None:
    kind = f"{OURS}/PublishedCounts"
    result = check(write_finished(tmp_path / "bag", refused=[("/strange/published", kind, b"\0\1\0\0\1")]))
    (missing,) = texts(result, Severity.MISSING)
    assert "cannot be decoded" in missing


def test_an_unfinished_run_is_not(tmp_path: Path) -> None:
    result = check(write_finished(tmp_path / "bag", finished=False))
    assert texts(result, Severity.MISSING) == ["the run was not finished when the recording ended, at 0.2 s"]
    assert not result.damaged


def test_stamps_and_messages_that_never_came_are_told(tmp_path: Path) -> None:
    result = check(write_finished(tmp_path / "bag", skipped=30))
    assert texts(result, Severity.MISSING) == [
        "/joint_states: 30 of 201 stamps are missing, the largest gap is 31 ms",
        "/joint_states: 171 of 201 messages are there (published)",
    ]


def test_a_chunk_that_is_lost_is_told_with_every_topic(tmp_path: Path) -> None:
    folder = write_finished(tmp_path / "bag")
    file = folder / "bag_0.mcap"
    content = bytearray(file.read_bytes())
    chunk = chunks_of(file)[4]
    content[chunk.end - 30] ^= 4
    file.write_bytes(content)
    result = check(folder)
    (damage,) = texts(result, Severity.DAMAGED)
    assert f"bytes {chunk.begin} to {chunk.end}" in damage
    count = TICKS - sum(message.topic == "/joint_states" for message in chunk.messages)
    claims = "statistics, metadata.yaml, published, loss ledger"
    assert f"/joint_states: {count} of 201 messages are there ({claims})" in texts(result, Severity.MISSING)


def test_a_bag_that_was_not_closed_says_so(tmp_path: Path) -> None:
    folder = write_finished(tmp_path / "bag")
    file = folder / "bag_0.mcap"
    file.write_bytes(file.read_bytes()[: chunks_of(file)[5].begin])
    (folder / "metadata.yaml").unlink()
    result = check(folder)
    assert any("was not closed" in line for line in texts(result, Severity.DAMAGED))
    missing = " ".join(texts(result, Severity.MISSING))
    assert "metadata.yaml is not there" in missing
    assert "there is no loss ledger" in missing
    assert "not finished" in missing


@pytest.mark.parametrize(
    ("field", "value", "told"),
    [
        ("message_count", 5, "contradicts itself"),
        ("relative_file_paths", ["bag_0.mcap", "bag_1.mcap"], "bag_1.mcap is not there"),
        ("relative_file_paths", [], "bag_0.mcap is there, metadata.yaml does not list it"),
        ("topics_with_message_count", [], "messages are there, more than stated"),
        ("topics_with_message_count", 3, "not readable"),
    ],
)
def test_a_wrong_metadata_file_is_told(tmp_path: Path, field: str, value: object, told: str) -> None:
    folder = write_finished(tmp_path / "bag")
    file = folder / "metadata.yaml"
    body = yaml.safe_load(file.read_text())
    body["rosbag2_bagfile_information"][field] = value
    file.write_text(yaml.safe_dump(body))
    result = check(folder)
    assert not result.complete
    assert any(told in finding.text for finding in result.findings), result.findings


def test_a_metadata_file_that_is_none_is_told(tmp_path: Path) -> None:
    folder = write_finished(tmp_path / "bag")
    (folder / "metadata.yaml").write_text("[1, 2")
    assert any("metadata.yaml is not readable" in line for line in texts(check(folder), Severity.DAMAGED))


def bomb(key: str) -> str:
    """Return a metadata file in which a list is as long as a thousand million words, written out."""
    levels = [f"  k{n}: &k{n} [{', '.join([f'*k{n - 1}'] * 10)}]\n" for n in range(1, 10)]
    return f"rosbag2_bagfile_information:\n  k0: &k0 lol\n{''.join(levels)}  {key}: *k9\n"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("#" * (LARGEST_METADATA + 1), f"more than {LARGEST_METADATA} bytes"),
        (bomb("relative_file_paths"), "written out it is too large"),
        ("a: " + "[" * 100_000, "more than 32 levels"),
    ],
    ids=["too much", "a bomb of aliases", "levels"],
)
def test_a_metadata_file_without_bounds_is_not_read(tmp_path: Path, text: str, told: str) -> None:
    folder = write_finished(tmp_path / "bag")
    (folder / "metadata.yaml").write_text(text)
    (damage,) = [line for line in texts(check(folder), Severity.DAMAGED) if "metadata.yaml" in line]
    assert told in damage and len(damage) < 500


def test_the_metadata_of_a_large_bag_is_read(tmp_path: Path) -> None:
    """A bag of 3000 files, whose description is longer than a file of a user may be."""
    spans = [FileSpan(f"bag_{number}.mcap", 0, 1, 1) for number in range(3000)]
    text = to_yaml({ROSBAG2_KEY: bag_information(spans, [])})
    assert len(text) > LARGEST_FILE
    (tmp_path / "metadata.yaml").write_text(text)
    read = metadata_of(tmp_path)
    assert read and len(read["files"]) == 3000


def patched(file: Path, old: bytes, new: bytes, *, last: bool = True) -> None:
    """Replace bytes in a file, and take away the checksum that would tell."""
    content = file.read_bytes()
    place = content.rindex(old) if last else content.index(old)
    content = content[:place] + new + content[place + len(old) :]
    file.write_bytes(content[:-12] + bytes(4) + content[-8:])


def test_an_index_that_points_elsewhere_is_told(tmp_path: Path) -> None:
    file = tmp_path / "a.mcap"
    write_file(file)
    assert check(file).complete
    chunk = chunks_of(file)[2]
    patched(file, chunk.begin.to_bytes(8, "little"), (chunk.begin + 1).to_bytes(8, "little"))
    result = check(file)
    assert f"a.mcap: the index names a chunk at byte {chunk.begin + 1}: wrong" in texts(
        result, Severity.DAMAGED
    )


def test_statistics_that_are_wrong_are_told(tmp_path: Path) -> None:
    file = tmp_path / "a.mcap"
    write_file(file)
    counts = b"".join(n.to_bytes(2, "little") + (60).to_bytes(8, "little") for n in (1, 2))
    wrong = counts[:2] + (61).to_bytes(8, "little") + counts[10:]
    patched(file, counts, wrong)
    assert "/text: 60 of 61 messages are there (statistics)" in texts(check(file), Severity.MISSING)


def test_a_summary_whose_checksum_fails_is_told(tmp_path: Path) -> None:
    file = tmp_path / "a.mcap"
    content = bytearray(write_file(file))
    content[-9] ^= 1
    file.write_bytes(content)
    assert any("checksum of the summary" in line for line in texts(check(file), Severity.DAMAGED))


def test_a_message_index_that_lies_is_told(tmp_path: Path) -> None:
    file = tmp_path / "a.mcap"
    content = bytearray(write_file(file))
    chunk = chunks_of(file)[2]
    content[chunk.end + 9 + 6] ^= 1  # the log time of the first entry
    file.write_bytes(content)
    assert "a.mcap: the message index is wrong for 1 chunks" in texts(check(file), Severity.DAMAGED)


@pytest.mark.parametrize("compression", list(CompressionType))
def test_a_whole_bag_of_others_is_complete(tmp_path: Path, compression: CompressionType) -> None:
    write_file(tmp_path / "a.mcap", compression)
    result = check(tmp_path / "a.mcap")
    assert result.complete and not result.is_ours
    assert any("no loss ledger" in line for line in texts(result, Severity.NOTE))


def test_a_bag_without_index_is_complete_and_slow(tmp_path: Path) -> None:
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = Writer(stream, index_types=IndexType.NONE, use_statistics=False)
        writer.start("ros2")
        channel = writer.register_channel(
            "/t", "cdr", writer.register_schema(STRING, "ros2msg", b"string data")
        )
        for time_ns in (5, 3, 9):
            writer.add_message(channel, time_ns, TYPES.serialize(text("x")), 0)
        writer.finish()
    result = check(tmp_path / "a.mcap")
    notes = " ".join(texts(result, Severity.NOTE))
    assert result.complete and "has no index" in notes and "has no statistics" in notes
    assert "/t: 1 messages are out of order" in notes


def test_schemas_are_tried_on_the_messages(tmp_path: Path) -> None:
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        data = TYPES.serialize(joint_state(0))
        for topic, encoding, schema_encoding, schema in (
            ("/broken", "cdr", "ros2msg", b"strin? data"),
            ("/incomplete", "cdr", "ros2msg", b"other_msgs/Thing thing"),
            ("/misfit", "cdr", "ros2msg", b"float64[5] values"),
            ("/json", "json", "jsonschema", b"{}"),
            ("/none", "cdr", "", b""),
        ):
            number = writer.register_schema("a_msgs/msg/A", schema_encoding, schema)
            writer.add_message(writer.register_channel(topic, encoding, number), 0, data, 0)
        writer.finish()
    result = check(tmp_path / "a.mcap")
    notes = " ".join(texts(result, Severity.NOTE))
    assert result.complete
    for topic in ("/broken", "/incomplete", "/misfit", "/json", "/none"):
        assert f"{topic} cannot be decoded" in notes


def test_part_of_a_split_bag_that_is_empty_or_gone_is_told(tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    for number in range(3):
        write_file(tmp_path / "bag" / f"bag_{number}.mcap")
    (tmp_path / "bag" / "bag_1.mcap").write_bytes(b"")
    assert "bag_1.mcap is empty" in texts(check(tmp_path / "bag"), Severity.DAMAGED)


@pytest.mark.parametrize("content", [b"", b"these are notes", bytes(100)])
def test_what_is_no_bag_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.mcap").write_bytes(content)
    with pytest.raises(BagError, match="is not a bag"):
        check(tmp_path / "a.mcap")


def test_other_kinds_of_bags_are_refused_with_a_way_out(tmp_path: Path) -> None:
    for name in ("a.db3", "a.bag", "a.db3.zstd"):
        folder = tmp_path / f"of_{name}"
        folder.mkdir()
        (folder / name).touch()
        with pytest.raises(BagError, match=r"only \.mcap files are read; 'rosbags-convert --src"):
            check(folder)
        shutil.copy(folder / name, tmp_path / name)
        with pytest.raises(BagError, match=r"only \.mcap files are read"):
            check(tmp_path / name)
