"""What a table holds is what the bag holds, bit for bit, for our runs and for any other bag."""

import base64
import csv
import json
import struct
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from mcap.writer import Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.io import loadmat

from sms_handover.bag.recording import Recording
from sms_handover.bag.topic_choice import TopicChoice
from sms_handover.cli.main import main
from sms_handover.errors import BagError, ConfigurationError, MissingDependencyError
from sms_handover.export.data_frames import data_frames
from sms_handover.export.export import CSV, MATLAB, PARQUET, export
from sms_handover.export.selection import Selection
from sms_handover.run_data import RunData

from .bag_damage import chunks_of, write_file
from .bag_messages import ARMS, JOINTS, TYPES, made_up_run, open_topics, record_run

EVERYTHING = Selection()
FORMATS = (CSV, PARQUET)  # the third has variables in place of columns, and a test of its own
CASES = Path(__file__).resolve().parents[1] / "data" / "cases"


def write_run(folder: Path, run: RunData) -> Path:
    with Recording(folder, types=TYPES) as recording:
        open_topics(recording)
        recording.begin()
        record_run(recording, run)
    return folder


def read(folder: Path, name: str, file_format: str) -> dict[str, list[Any]]:
    """Return the columns of a table, of a CSV file by the kinds that tables.json tells."""
    file = folder / f"{name}.{file_format}"
    told = json.loads((folder / "tables.json").read_text())["tables"][file.name]
    if file_format == PARQUET:
        table = pq.read_table(file)
        assert table.num_rows == told["rows"]
        return {name: table[name].to_pylist() for name in table.column_names}
    with file.open(newline="", encoding="utf-8") as stream:
        heading, *rows = csv.reader(stream)
    assert len(rows) == told["rows"]
    assert heading == [column["name"] for column in told["columns"]]
    parts = list(zip(*rows, strict=True)) or [()] * len(heading)
    return {
        column["name"]: [parsed(cell, column["kind"]) for cell in cells]
        for column, cells in zip(told["columns"], parts, strict=True)
    }


def parsed(cell: str, kind: str) -> Any:
    """Return a CSV cell as its kind."""
    if kind.startswith(("list", "struct")):
        return json.loads(cell, parse_constant=refuse_constant)
    if kind == "binary":
        return base64.b64decode(cell)
    if kind == "bool":
        return {"true": True, "false": False}[cell]
    return cell if kind == "string" else (float(cell) if "float" in kind else int(cell))


def bits(values: Any) -> bytes:
    return np.array(values, dtype=np.float64).tobytes()


@pytest.mark.parametrize("file_format", FORMATS)
def test_a_run_reads_back_bit_for_bit(tmp_path: Path, file_format: str) -> None:
    run = made_up_run()
    result = export(write_run(tmp_path / "bag", run), tmp_path / "out", file_format, EVERYTHING)
    assert result.rows == {"ticks": 101, "references": 6, "grasp_events": 2, "run_events": 2}
    ticks = read(result.folder, "ticks", file_format)
    assert ticks["stamp_ns"] == run.tick_ns.tolist()
    for place, joint in enumerate(JOINTS):
        for quantity, values in (
            ("position", run.joint_position),
            ("velocity", run.joint_velocity),
            ("effort", run.joint_effort),
            ("command", run.joint_command),
        ):
            assert bits(ticks[f"{joint}.{quantity}"]) == values[:, place].tobytes()
    assert bits(ticks["base.orientation.w"]) == run.base_pose[:, 6].tobytes()
    assert bits(ticks["base.angular_velocity.x"]) == run.base_twist[:, 3].tobytes()
    references = read(result.folder, "references", file_format)
    assert references["stamp_ns"] == run.reference_ns.tolist()
    for arm in ARMS:
        assert bits(references[f"{arm}.tool.position.y"]) == run.tool_pose[arm][:, 1].tobytes()
        assert bits(references[f"{arm}.target.orientation.x"]) == run.target_pose[arm][:, 3].tobytes()
    assert bits(references["angular_momentum.z"]) == run.angular_momentum[:, 2].tobytes()
    assert bits(references["work"]) == run.work.tobytes()
    assert references["ik_status"] == run.ik_status.tolist()
    assert references["phase.name"] == [phase.name for phase in run.phases]
    events = read(result.folder, "grasp_events", file_format)
    assert events["status"] == ["succeeded", "missed"]
    assert events["from_arm"] == ["", "arm_a"]
    assert np.isnan(events["relative_speed"][1])
    decisions = read(result.folder, "run_events", file_format)
    assert decisions["kind"] == ["begun", "late"]
    assert decisions["severity"] == ["info", "error"]
    assert np.isnan(decisions["value"][0])
    assert (decisions["value"][1], decisions["limit"][1], decisions["unit"][1]) == (0.2, 0.1, "s")


@pytest.mark.parametrize("file_format", FORMATS)
def test_what_was_not_recorded_is_nan(tmp_path: Path, file_format: str) -> None:
    """A command that is missing leaves its row; numbers at the edge of float64 come back too."""
    run = made_up_run(21)
    position = run.joint_position.copy()
    position[0, :5] = (-0.0, 5e-324, 1.7976931348623157e308, 0.1, np.inf)
    command = run.joint_command.copy()
    command[3] = np.nan
    values = {**vars(run), "joint_position": position, "joint_command": command}
    export(write_run(tmp_path / "bag", RunData(**values)), tmp_path / "out", file_format, EVERYTHING)
    ticks = read(tmp_path / "out", "ticks", file_format)
    firsts = [ticks[f"{joint}.position"][0] for joint in JOINTS]
    assert bits(firsts) == position[0].tobytes()
    assert np.isnan(ticks[f"{JOINTS[0]}.command"][3])


def test_a_run_goes_to_matlab_bit_for_bit(tmp_path: Path) -> None:
    run = made_up_run()
    export(write_run(tmp_path / "bag", run), tmp_path / "out", MATLAB, EVERYTHING)
    ticks = loadmat(tmp_path / "out" / "ticks.mat", simplify_cells=True)
    assert ticks["stamp_ns"].tolist() == run.tick_ns.tolist()
    assert bits(ticks["arm_a_joint_1_position"]) == run.joint_position[:, 0].tobytes()
    assert dict(zip(ticks["columns"], ticks["units"], strict=True))["arm_a_joint_1.effort"] == "N m"
    events = loadmat(tmp_path / "out" / "grasp_events.mat", simplify_cells=True)
    assert events["status"].tolist() == ["succeeded", "missed"] and np.isnan(events["relative_speed"][1])


def test_data_frames_are_the_tables_of_an_export(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Read back by pandas itself; without it one line names the extra."""
    run = made_up_run()
    export(write_run(tmp_path / "bag", run), tmp_path / "out", PARQUET, EVERYTHING)
    frames = data_frames(run)
    assert {file.stem for file in (tmp_path / "out").glob("*.parquet")} == frames.keys()
    for name, frame in frames.items():
        written = pd.read_parquet(tmp_path / "out" / f"{name}.parquet")
        pd.testing.assert_frame_equal(frame, written, check_exact=True)
    assert frames["ticks"].attrs["units"]["arm_a_joint_1.effort"] == "N m"
    assert bits(frames["ticks"]["arm_a_joint_1.position"]) == run.joint_position[:, 0].tobytes()
    frames["ticks"].loc[0, "arm_a_joint_1.position"] = 7.0
    assert run.joint_position[0, 0] != 7.0
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingDependencyError, match=r"data frames need pandas.*'sms_handover\[pandas\]'"):
        data_frames(run)


def test_units_are_told(tmp_path: Path) -> None:
    bag = write_run(tmp_path / "bag", made_up_run(21))
    export(bag, tmp_path / "out", PARQUET, EVERYTHING)
    told = json.loads((tmp_path / "out" / "tables.json").read_text())
    columns = {column["name"]: column for column in told["tables"]["ticks.parquet"]["columns"]}
    assert columns["arm_a_joint_1.effort"] == {
        "name": "arm_a_joint_1.effort",
        "kind": "float64",
        "unit": "N m",
    }
    field = pq.read_schema(tmp_path / "out" / "ticks.parquet").field("base.linear_velocity.x")
    assert field.metadata == {b"unit": b"m/s"}


def test_a_range_of_time_has_both_its_ends(tmp_path: Path) -> None:
    bag = write_run(tmp_path / "bag", made_up_run())
    result = export(bag, tmp_path / "a", CSV, Selection(start=0.02, end=0.04))
    assert read(result.folder, "ticks", CSV)["stamp_ns"] == list(range(20_000_000, 40_000_001, 1_000_000))
    assert read(result.folder, "references", CSV)["stamp_ns"] == [20_000_000, 40_000_000]
    chosen = Selection(TopicChoice(("joint_states",)), 0.02, 0.04)
    result = export(bag, tmp_path / "b", CSV, chosen)
    assert result.rows == {"joint_states": 21}
    with pytest.raises(ConfigurationError, match="the range from 2 s to 1 s is empty"):
        Selection(start=2.0, end=1.0)


@pytest.mark.parametrize("file_format", FORMATS)
def test_topics_of_a_run_are_their_messages(tmp_path: Path, file_format: str) -> None:
    run = made_up_run(41)
    choice = TopicChoice(regex="^/(joint_states|task/phase)$")
    result = export(write_run(tmp_path / "bag", run), tmp_path / "out", file_format, Selection(choice))
    assert set(result.rows) == {"joint_states", "task.phase"}
    states = read(result.folder, "joint_states", file_format)
    assert [bits(row) for row in states["position"]] == [row.tobytes() for row in run.joint_position]
    assert states["name"][0] == list(JOINTS)
    phases = read(result.folder, "task.phase", file_format)
    assert [len(commands) for commands in phases["commands"]] == [0, 0, 2]
    assert phases["commands"][2][1]["from_arm"] == "arm_a"


CUSTOM = """
int8 small
uint64 large
float32 single
float64[3] vector
float64[] values
uint8[] raw
bool flag
string text
string[] texts
other_msgs/Part part
other_msgs/Part[] parts
int32 from
uint8 CONSTANT=3
================================================================================
MSG: other_msgs/Part
builtin_interfaces/Time when
bool[2] flags
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


def custom_messages(store: Any, count: int) -> list[Any]:
    """Return messages of every kind of field."""
    kinds, time = store.types, store.types["builtin_interfaces/msg/Time"]
    random = np.random.default_rng(0)

    def part(number: int) -> Any:
        flags = np.array([number % 2 == 0, True])
        return kinds["other_msgs/msg/Part"](when=time(sec=-number, nanosec=5), flags=flags)

    return [
        kinds["other_msgs/msg/Custom"](
            small=-number,
            large=2**64 - 1 - number,
            single=struct.unpack("f", struct.pack("f", 0.1 * number))[0],
            vector=random.standard_normal(3),
            values=random.standard_normal(number),
            raw=np.frombuffer(random.bytes(number), dtype=np.uint8),
            flag=number % 2 == 1,
            text='quoted " comma, line\nbreak\r and ä' * number,
            texts=["a", ""][:number],
            part=part(number),
            parts=[part(n) for n in range(number)],
            from_=number,
        )
        for number in range(count)
    ]


@pytest.mark.parametrize("file_format", FORMATS)
@pytest.mark.parametrize("mode", [CompressionMode.NONE, CompressionMode.STORAGE])
def test_a_bag_of_another_robot(tmp_path: Path, file_format: str, mode: CompressionMode) -> None:
    """Types that only the bag knows, names that no file may have, no ledger."""
    store = get_typestore(Stores.EMPTY)
    known = store.fielddefs
    types = get_types_from_msg(CUSTOM.strip(), "other_msgs/msg/Custom")
    store.register({name: fields for name, fields in types.items() if name not in known})
    messages = custom_messages(store, 4)
    writer = RosbagsWriter(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    topics = ("/a/b c", "/a.b_c", "/A/B_C")
    with writer:
        for topic in topics:
            connection = writer.add_connection(topic, "other_msgs/msg/Custom", typestore=store)
            for number, message in enumerate(messages):
                data = store.serialize_cdr(message, "other_msgs/msg/Custom")
                writer.write(connection, 10**18 + number * 10**9, data)
    result = export(tmp_path / "bag", tmp_path / "out", file_format, EVERYTHING)
    assert list(result.rows.values()) == [4, 4, 4]
    assert len({name.lower() for name in result.rows}) == 3
    for name in result.rows:
        table = read(result.folder, name, file_format)
        assert table["log_time_ns"] == [10**18 + number * 10**9 for number in range(4)]
        assert table["small"] == [0, -1, -2, -3]
        assert table["large"] == [2**64 - 1 - number for number in range(4)]
        assert bits(table["single"]) == bits([message.single for message in messages])
        assert bits(table["vector[1]"]) == bits([message.vector[1] for message in messages])
        assert [bits(row) for row in table["values"]] == [bits(message.values) for message in messages]
        assert table["raw"] == [message.raw.tobytes() for message in messages]
        assert table["flag"] == [False, True, False, True]
        assert table["text"] == [message.text for message in messages]
        assert table["texts"] == [[], ["a"], ["a", ""], ["a", ""]]
        assert table["part.when.sec"] == [0, -1, -2, -3]
        assert table["part.flags[0]"] == [True, False, True, False]
        assert table["parts"][2] == [
            {"when": {"sec": 0, "nanosec": 5}, "flags": [True, True]},
            {"when": {"sec": -1, "nanosec": 5}, "flags": [False, True]},
        ]
        assert table["from"] == [0, 1, 2, 3]
        assert "CONSTANT" not in table
    later = export(tmp_path / "bag", tmp_path / "later", file_format, Selection(start=1.5))
    assert list(later.rows.values()) == [2, 2, 2]


NUMBERS = (
    """byte b
char c
int8 i
uint64 u
byte[2] byte_pair
char[2] char_pair
int8[2] int_pair
byte[] byte_list
int8[] int_list
uint64[] long_list
float64[] floats
a_msgs/In[] nested
"""
    + f"""{"=" * 80}
MSG: a_msgs/In
byte b
int8[] int_list
byte[] byte_list
float32 f
float64[] floats
"""
)
MOST = 2**64 - 1
ODD = [float("nan"), float("-inf"), 1e308]


def sequence(data: bytes, code: str, *items: float) -> bytes:
    """Return CDR with a sequence behind it."""
    data = aligned(data, 4) + struct.pack("<I", len(items))
    return aligned(data, struct.calcsize(code)) + struct.pack(f"<{len(items)}{code}", *items)


def aligned(data: bytes, size: int) -> bytes:
    return data + b"\0" * (-len(data) % size)


@pytest.mark.parametrize("file_format", FORMATS)
def test_numbers_at_the_edges_of_their_types_survive(tmp_path: Path, file_format: str) -> None:
    """The bytes are packed by hand: what packs and reads them in the package could be wrong alike."""
    data = aligned(bytes([255, 254, 128]), 8) + struct.pack("<Q", MOST) + bytes([255, 128, 255, 1, 128, 127])
    for code, items in (("B", (255, 128)), ("b", (-128, 127)), ("Q", (MOST, 2**63)), ("d", ODD)):
        data = sequence(data, code, *items)
    data = aligned(data, 4) + struct.pack("<I", 1) + bytes([255])
    data = sequence(sequence(data, "b", -128), "B", 255)
    data = sequence(aligned(data, 4) + struct.pack("<f", np.inf), "d", *ODD)
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        schema = writer.register_schema("a_msgs/msg/A", "ros2msg", NUMBERS.encode())
        writer.add_message(writer.register_channel("/a", "cdr", schema), MOST, b"\0\1\0\0" + data, MOST - 1)
        writer.finish()
    export(tmp_path / "a.mcap", tmp_path / "mat", MATLAB, EVERYTHING)
    content = loadmat(tmp_path / "mat" / "a.mat", simplify_cells=True)
    assert (content["log_time_ns"], content["b"], content["i"], content["u"]) == (MOST, 255, -128, MOST)
    assert content["byte_list"].tolist() == [255, 128] and content["int_list"].tolist() == [-128, 127]
    assert content["long_list"].tolist() == [MOST, 2**63] and bits(content["floats"]) == bits(ODD)
    assert content["nested"]["byte_list"] == 255 and content["nested"]["f"] == np.inf
    assert content["columns"].tolist()[6:8] == ["byte_pair[0]", "byte_pair[1]"]
    assert (content["byte_pair_0"], content["byte_pair_1"]) == (255, 128)
    export(tmp_path / "a.mcap", tmp_path / "out", file_format, EVERYTHING)
    table = {name: values[0] for name, values in read(tmp_path / "out", "a", file_format).items()}
    (inner,) = table.pop("nested")
    named = file_format == CSV
    odd = ["NaN", "-Infinity", 1e308] if named else ODD
    assert repr(inner.pop("floats")) == repr(odd) and repr(table.pop("floats")) == repr(odd)
    assert inner == {"b": 255, "int_list": [-128], "byte_list": [255], "f": "Infinity" if named else np.inf}
    assert table == {
        **{"log_time_ns": MOST, "publish_time_ns": MOST - 1, "b": 255, "c": 254, "i": -128, "u": MOST},
        **{"byte_pair[0]": 255, "byte_pair[1]": 128, "char_pair[0]": 255, "char_pair[1]": 1},
        **{"int_pair[0]": -128, "int_pair[1]": 127, "byte_list": b"\xff\x80", "int_list": [-128, 127]},
        "long_list": [MOST, 2**63],
    }


def refuse_constant(text: str) -> None:
    raise AssertionError(f"{text} is no JSON")


@pytest.mark.parametrize("file_format", FORMATS)
@pytest.mark.parametrize("case", ["byte_255", "nan_in_arrays"])
def test_bags_of_others(tmp_path: Path, case: str, file_format: str) -> None:
    export(CASES / f"{case}.mcap", tmp_path / "out", file_format, EVERYTHING)
    table = read(tmp_path / "out", "t", file_format)
    if case == "byte_255":
        assert table["by"] == [255]
    else:
        assert str(table["ranges"][0][1]).lower().startswith("inf")


def test_a_split_bag_has_one_table_per_topic(tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    for number in range(3):
        write_file(tmp_path / "bag" / f"bag_{number}.mcap")
    progress: list[int] = []
    result = export(
        tmp_path / "bag", tmp_path / "out", CSV, EVERYTHING, progress=lambda done, size: progress.append(done)
    )
    assert result.rows == {"text": 180, "joints": 180, "none": 0}
    assert progress == sorted(progress)


def test_what_cannot_be_decoded_is_left_out_and_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        for topic, encoding, schema in (("/json", "json", b"{}"), ("/good", "cdr", b"int32 value")):
            number = writer.register_schema("a_msgs/msg/A", "ros2msg", schema)
            channel = writer.register_channel(topic, encoding, number)
            writer.add_message(channel, 0, b"\0\1\0\0\7\0\0\0", 0)
        writer.add_message(channel, 1, b"\0\1\0\0\7", 1)
        writer.finish()
    result = export(tmp_path / "a.mcap", tmp_path / "out", CSV, EVERYTHING)
    assert result.rows == {"good": 1}
    assert "json encoding" in result.skipped["/json"] and "does not decode" in result.skipped["/good"]
    assert result.left_out == {"/json": 1, "/good": 1}
    assert main(["bag", "export", str(tmp_path / "a.mcap"), "-o", str(tmp_path / "again")]) == 3
    assert "not exported: /good: 1 messages: a message does not decode" in capsys.readouterr().err
    with pytest.raises(BagError, match=r"nothing to export from .*json encoding"):
        export(tmp_path / "a.mcap", tmp_path / "none", CSV, Selection(TopicChoice(("/json",))))
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize("damage", ["cut", "flipped", "empty"])
def test_a_damaged_bag_is_refused_and_leaves_nothing(tmp_path: Path, damage: str) -> None:
    file = tmp_path / "a.mcap"
    content = bytearray(write_file(file))
    content[chunks_of(file)[3].end - 9] ^= 1
    broken = {"cut": content[:3000], "flipped": content, "empty": bytearray()}
    file.write_bytes(broken[damage])
    with pytest.raises(BagError, match="is empty" if damage == "empty" else "sms-handover bag recover"):
        export(file, tmp_path / "out", CSV, EVERYTHING)
    assert not (tmp_path / "out").exists()


def test_wrong_use_is_told(tmp_path: Path) -> None:
    write_file(tmp_path / "a.mcap")
    (tmp_path / "out").mkdir()
    with pytest.raises(ConfigurationError, match="exists, choose another"):
        export(tmp_path / "a.mcap", tmp_path / "out", CSV, EVERYTHING)
    with pytest.raises(ConfigurationError, match="has no topic /absent; it has /text, /joints, /none"):
        export(tmp_path / "a.mcap", tmp_path / "new", CSV, Selection(TopicChoice(("absent",))))
    with pytest.raises(ConfigurationError, match=r"cannot create .*: No such file"):
        export(tmp_path / "a.mcap", tmp_path / "no" / "new", CSV, EVERYTHING)


@pytest.mark.parametrize(("file_format", "module"), [(PARQUET, "pyarrow"), (MATLAB, "scipy.io")])
def test_a_format_whose_library_is_missing_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file_format: str, module: str
) -> None:
    write_file(tmp_path / "a.mcap")
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ConfigurationError, match=rf"pip install 'sms_handover\[{file_format}\]'"):
        export(tmp_path / "a.mcap", tmp_path / "out", file_format, EVERYTHING)
    assert not (tmp_path / "out").exists()
