"""What the bag of a run over DDS holds, and the commands that read it."""

import json
import os
import shutil
import signal
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rerun.chunk import RrdReader
from rosbags.highlevel import AnyReader

from sms_handover.bag.info import BagInfo, read_info
from sms_handover.bag.run.reader import read_run
from sms_handover.bag.writer import BagWriter
from sms_handover.frames import DEPUTY, target_frame
from sms_handover.graph.events import PLAN_FAILED
from sms_handover.graph.topics import LOOP_NODES, NODES, Rate, graph_topics
from sms_handover.plan_report import PlanStatus
from sms_handover.run_data import RunData
from sms_handover.scene.recorded_scene import read_scene
from sms_handover.simulation.scenario import load_scenario

from ..core.layout_paths import (
    foxglove_paths,
    foxglove_value,
    last_messages,
    plotjuggler_curves,
    plotjuggler_value,
)
from ..transforms import TransformTree, matrix_of
from .conftest import LAWS, TICKS, Command
from .runs import Ended, running, solvers_of

pytestmark = [pytest.mark.system, pytest.mark.slow]

Recorded = dict[str, tuple[Path, Ended]]

PERIODS = (TICKS - 1) // 20 + 1
COUNTS = {Rate.TICK: TICKS, Rate.REFERENCE: PERIODS, Rate.CLOCK: (TICKS - 1) // 10 + 1}
TOPICS = graph_topics(("arm_a", "arm_b"))


@pytest.fixture(params=LAWS)
def bag(request: pytest.FixtureRequest, recorded: Recorded) -> Path:
    """The bag of a run under each law."""
    return recorded[request.param][0] / "bag"


def expected() -> dict[str, int]:
    """Return how many messages the topics of the loop must have."""
    counts = {f"/{t.name.lstrip('/')}": COUNTS[t.rate] for t in TOPICS if t.rate in COUNTS}
    return {**counts, "/tf": 2 * PERIODS, "/tf_static": 1, "/task/grasp_event": 2, "/robot_description": 1}


def of_expected(counts: Counter[str]) -> dict[str, int]:
    return {name: counts[name] for name in expected()}


def test_no_message_is_missing(bag: Path) -> None:
    info = read_info(bag)
    assert of_expected(Counter({t.name: t.message_count for t in info.topics.values()})) == expected()
    ledger = info.ledger
    assert ledger is not None and ledger.complete
    accounts = {account.name: account for account in ledger.topics}
    for topic in TOPICS:
        if topic.is_from_outside:
            continue  # what the plant makes of it is recorded
        account = accounts[f"/{topic.name.lstrip('/')}"]
        if topic.rate in COUNTS:
            assert account.received == account.published == COUNTS[topic.rate] * len(topic.publishers), topic
            assert account.missing == account.duplicates == 0, topic.name
            if len(topic.publishers) == 1:  # those of several come in any order
                assert account.out_of_order == 0, topic.name
    assert info.topics["/run/published"].message_count == len(LOOP_NODES)


def test_mcap_reads_it(bag: Path) -> None:
    counts: Counter[str] = Counter()
    with (bag / "bag_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        for _, channel, message in reader.iter_messages():
            counts[channel.topic] += 1
            assert message.data[:2] == b"\0\1"  # little-endian CDR
    assert of_expected(counts) == expected()


def test_mcap_ros2_support_reads_it(bag: Path) -> None:
    counts: Counter[str] = Counter()
    with (bag / "bag_0.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            counts[channel.topic] += 1
            if channel.topic == "/joint_states":
                assert len(decoded.name) == len(decoded.position) == 14
                stamp_ns = decoded.header.stamp.sec * 10**9 + decoded.header.stamp.nanosec
                assert stamp_ns == message.log_time
    assert of_expected(counts) == expected()


def test_rosbags_reads_it(bag: Path) -> None:
    counts: Counter[str] = Counter()
    run = read_run(bag)
    positions = []
    with AnyReader([bag]) as reader:
        for connection, _, raw in reader.messages():
            message: Any = reader.deserialize(raw, connection.msgtype)
            counts[connection.topic] += 1
            if connection.topic == "/joint_states":
                positions.append(message.position)
        assert reader.message_count == counts.total()
    assert of_expected(counts) == expected()
    assert [row.tobytes() for row in positions] == [row.tobytes() for row in run.joint_position]


def test_metadata_is_that_of_rosbag2(bag: Path) -> None:
    text = (bag / "metadata.yaml").read_text(encoding="utf-8")
    metadata = yaml.safe_load(text)["rosbag2_bagfile_information"]
    info = read_info(bag)
    assert metadata["message_count"] == info.message_count
    assert metadata["storage_identifier"] == "mcap"
    assert metadata["relative_file_paths"] == ["bag_0.mcap"]
    assert metadata["duration"]["nanoseconds"] == (TICKS - 1) * 1_000_000


def test_it_stands_on_its_own(recorded: Recorded, schedule: Path) -> None:
    robot = load_scenario().truth.robot
    for law, (folder, _) in recorded.items():
        info: BagInfo = read_info(folder / "bag")
        assert info.schedule_text == schedule.read_text(encoding="utf-8")
        assert info.urdf_text == robot.urdf
        assert set(info.parameters) == set(NODES)
        assert info.parameters["controller"]["law"] == law
        for name in NODES:
            assert info.parameters[name]["peers"] == list(NODES)
            assert info.parameters[name]["schedule"] == str(schedule)
        provenance = dict(info.provenance)
        assert {"start", "git_revision", "git_state", "seed", "python", "platform"} <= set(provenance)
        assert provenance["version.pin"] != "unknown" != provenance["version.mcap"]


def test_laws_share_everything_but_the_commands(recorded: Recorded) -> None:
    """Both begin in the same state, and part with the first command."""
    runs: dict[str, RunData] = {law: read_run(folder / "bag") for law, (folder, _) in recorded.items()}
    nmpc, pid = runs["nmpc"], runs["pid"]
    assert nmpc.joint_position[0].tobytes() == pid.joint_position[0].tobytes()
    assert nmpc.joint_command[0].tobytes() != pid.joint_command[0].tobytes()


def test_a_bag_reproduces_itself(recorded: Recorded, tmp_path: Path, called: Command) -> None:
    """From a bag alone: the schedule and the output folder of then need not be there."""
    for law, (folder, _) in recorded.items():
        shutil.copytree(folder / "bag", tmp_path / law)
        again = called("verify", law, cwd=tmp_path)
        assert (again.code, again.err) == (0, "")
        assert f"the same bit for bit: {TICKS} states, {PERIODS} references" in again.out


def test_verify_tells_what_it_cannot_use(tmp_path: Path, called: Command) -> None:
    (tmp_path / "empty").mkdir()
    BagWriter(tmp_path / "foreign").close()
    for folder, told in (("nowhere", "no bag"), ("empty", "not a bag"), ("foreign", "no run")):
        done = called("verify", folder, cwd=tmp_path)
        assert (done.code, len(done.errors)) == (2, 1), done
        assert told in done.errors[0]
        assert done.err.count("\n") == 1


def test_compare_prints_a_table_and_writes_figures(
    recorded: Recorded, tmp_path: Path, called: Command
) -> None:
    folders = [folder for folder, _ in recorded.values()]
    done = called("compare", *folders, "--json", "figures.json", cwd=tmp_path)
    assert done.code == 0, done
    table = done.out.splitlines()
    assert any("nmpc" in line and "pid" in line for line in table)
    assert "arm_b takes end_b from arm_a" in done.out
    figures = json.loads((tmp_path / "figures.json").read_text(encoding="utf-8"))
    assert figures


def test_a_report_is_one_page_on_the_runs(recorded: Recorded, tmp_path: Path, called: Command) -> None:
    folders = [folder for folder, _ in recorded.values()]
    done = called("report", *folders, "-o", "report", cwd=tmp_path)
    assert done.code == 0, done
    page = tmp_path / "report" / "index.html"
    assert done.out.startswith(f"{page.relative_to(tmp_path)}: ")
    assert [path.name for path in (tmp_path / "report").iterdir()] == [page.name]
    text = page.read_text(encoding="utf-8")
    for part in ("nmpc and pid, side by side", "Claims of the paper", "no message missing", "srcdoc="):
        assert part in text, part


def test_real_time_ends_in_one_line_without_its_solver(tmp_path: Path) -> None:
    """Paced by the wall clock, with plans from a process that is killed: the arms brake, the bag is whole."""
    law = ("--controller", "mpc", "-p", "controller.failed_plans:=40")
    run = tmp_path / "run"
    with running("run", "paper", "--real-time", *law, "--duration=20", "-o", "run", cwd=tmp_path) as command:
        command.until(lambda: solvers_of(command.pid), "the process of the solver")
        command.until_recorded(run / "bag", 300_000)
        (solver,) = solvers_of(command.pid)
        os.kill(solver, signal.SIGKILL)
        code = command.end()
        printed = command.text
    assert code == 1, printed
    (line,) = [line for line in printed.splitlines() if "controller: error:" in line]
    assert "no plan" in line and line.endswith("the solver process was ended by SIGKILL")
    braking = "no plan for too long: the arms brake to rest; the solver process was ended by SIGKILL"
    info, data = read_info(run / "bag"), read_run(run / "bag")
    assert [event.detail for event in data.run_events if event.kind == PLAN_FAILED][-1] == braking
    assert info.topics["/loop_timing"].message_count > 0
    assert info.parameters["plant"]["mode"] == "realtime"
    numbers = [plan.plan for plan in data.plans]
    assert len(numbers) > 1 and numbers == sorted(set(numbers))
    assert data.plans[-1].status is PlanStatus.BRAKING and data.plans[-1].late_plans > 0
    rates, limit = np.abs(data.joint_velocity), load_scenario("paper").model.robot.effort_limit
    assert np.nanmax(rates[-1]) < 0.05 < np.nanmax(rates)
    assert np.nanmax(np.abs(data.joint_command) - limit) <= 0.0  # NaN where no command came in time


def test_the_transforms_in_the_bag_put_every_link_where_the_scene_has_it(bag: Path) -> None:
    """/tf was published while the run went on, the scene is computed anew from description and state."""
    scene = read_scene(bag)
    trees = {int(stamp_ns): TransformTree() for stamp_ns in scene.stamp_ns}
    with AnyReader([bag]) as reader:
        for connection, log_ns, data in reader.messages(
            [c for c in reader.connections if c.topic in ("/tf", "/tf_static")]
        ):
            message: Any = reader.deserialize(data, connection.msgtype)
            fixed = connection.topic == "/tf_static"
            for tree in trees.values() if fixed else filter(None, [trees.get(log_ns)]):
                tree.add(message)
    for row, tree in enumerate(trees.values()):
        shown = dict(zip(scene.links, scene.link_in_world[row], strict=True))
        shown[DEPUTY] = scene.deputy_in_world[row]
        shown.update((target_frame(arm), poses[row]) for arm, poses in scene.target_in_world.items())
        for frame, pose in shown.items():
            assert np.abs(tree.in_world(frame) - matrix_of(pose)).max() < 1e-12, frame


def test_the_robot_is_latched_and_every_link_has_a_transform(bag: Path) -> None:
    info = read_info(bag)
    (profile,) = yaml.safe_load(info.topics["/robot_description"].qos)
    assert (profile["durability"], profile["reliability"]) == ("transient_local", "reliable")
    messages = last_messages(bag)
    urdf = messages["/robot_description"][1].data
    assert urdf == info.urdf_text
    (profile,) = yaml.safe_load(info.topics["/tf_static"].qos)
    assert (profile["durability"], profile["reliability"]) == ("transient_local", "reliable")
    scale = messages["/deputy/marker"][1].scale
    assert (scale.x, scale.y, scale.z) == tuple(yaml.safe_load(info.schedule_text or "")["deputy"]["size"])


def test_the_layouts_for_other_tools_find_everything_they_name(bag: Path) -> None:
    messages = last_messages(bag)
    for path, _ in foxglove_paths():
        assert foxglove_value(path, messages) is not None, path
    for name in plotjuggler_curves():
        assert isinstance(plotjuggler_value(name, messages), float), name


def test_rerun_opens_a_bag_with_robot_and_transforms(bag: Path, tmp_path: Path) -> None:
    rerun = str(Path(sys.executable).with_name("rerun"))
    convert = [rerun, "mcap", "convert", str(bag / "bag_0.mcap"), "-o", str(tmp_path / "run.rrd")]
    done = subprocess.run(convert, capture_output=True, text=True, check=True)
    listed = done.stdout + done.stderr
    assert "/tf," in listed and "/tf_static," in listed
    for shape in read_scene(bag).shapes:
        assert f"/visual_geometries/{shape.link}/visual_0" in listed
    subprocess.run([rerun, "rrd", "verify", str(tmp_path / "run.rrd")], check=True)
    scene, trees = read_scene(bag), dict[int, TransformTree]()
    for chunk in RrdReader(str(tmp_path / "run.rrd")).stream():
        if chunk.entity_path in ("/tf", "/tf_static"):
            for row in chunk.to_record_batch().to_pylist():
                if parent := row.get("Transform3D:parent_frame"):
                    (at,), (turn,) = row["Transform3D:translation"], row["Transform3D:quaternion"]
                    stamp_ns = 0 if chunk.entity_path == "/tf_static" else row["message_log_time"].value
                    tree = trees.setdefault(stamp_ns, TransformTree())
                    tree.place(parent[0], row["Transform3D:child_frame"][0], np.array([*at, *turn]))
    for place, link in enumerate(scene.links):  # rerun keeps single precision
        error = trees[0].in_world(link) - matrix_of(scene.link_in_world[0, place])
        assert np.abs(error).max() < 2e-6, link
