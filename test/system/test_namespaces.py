"""Two graphs in two namespaces of one domain: recorded side by side without mixing, played, and shown."""

import json
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from sms_handover.bag.files import read_messages
from sms_handover.bag.info import read_info
from sms_handover.bag.run.reader import read_run
from sms_handover.graph.topics import CONTAINER, NODES, RECORDER, graph_topics
from sms_handover.launcher.domain import reserved_domain
from sms_handover.messages.message_types import MessageTypes
from sms_handover.ros.launching.launch_arguments import launch_processes
from sms_handover.scene.page import STREAM
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.units import NS_PER_S

from ..core.scene_documents import poses, times
from ..ros.short_handover import short_handover
from .runs import Running, running

pytestmark = [pytest.mark.system, pytest.mark.slow]

REMAPPED = ("--remap", "joint_states:=robot/joints")  # of every node of the second graph
LAWS = {"one": "nmpc", "two": "pid"}
HIDDEN = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_STATIC_PEERS": ""}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with the bags of two graphs that ran at the same time, in a domain that is still theirs."""
    folder = tmp_path_factory.mktemp("namespaces")
    schedule = folder / "schedule.yaml"
    schedule.write_text(short_handover(), encoding="utf-8")
    with (
        reserved_domain(None) as domain,
        pytest.MonkeyPatch.context() as patch,
        ExitStack() as stack,
    ):
        for name, value in {**HIDDEN, "ROS_DOMAIN_ID": str(domain)}.items():
            patch.setenv(name, value)
        recorders: list[Running] = []
        for namespace, law in LAWS.items():
            given = {"schedule": str(schedule), "controller": law, "bag": str(folder / namespace)}
            processes = launch_processes(given, record=True, compose=True)
            rules = ("--remap", f"__ns:=/{namespace}", *(REMAPPED if namespace == "two" else ()))
            for executable in (CONTAINER, RECORDER):
                module = f"sms_handover.nodes.{executable}"
                line = (*processes[executable].line, *rules)
                process = stack.enter_context(running(*line, cwd=folder, module=module))
                recorders += [process] if executable == RECORDER else []
        for recorder in recorders:
            assert recorder.end() == 0, recorder.text
        yield folder


def full_name(topic: str, namespace: str) -> str:
    """Return what the bag of a graph calls a topic."""
    renamed = {"joint_states": "robot/joints"} if namespace == "two" else {}
    name = renamed.get(topic, topic)
    return name if name.startswith("/") else f"/{namespace}/{name}"


@pytest.mark.parametrize("namespace", LAWS)
def test_each_bag_has_all_of_its_graph_and_nothing_of_the_other(folder: Path, namespace: str) -> None:
    info = read_info(folder / namespace)
    topics = [topic for topic in graph_topics(("arm_a", "arm_b")) if not topic.is_from_outside]
    own = {full_name(topic.name, namespace) for topic in topics}
    assert own <= set(info.topics)
    (other,) = LAWS.keys() - {namespace}
    assert not [name for name in info.topics if name.startswith(f"/{other}/")]
    assert info.ledger is not None and info.ledger.complete
    by_name = {account.name: account for account in info.ledger.topics}
    evenly = [account for account in info.ledger.topics if account.period_ns]
    assert all(account.duplicates == account.out_of_order == 0 for account in evenly)
    assert by_name["/clock"].received == by_name["/clock"].published
    assert set(info.parameters) == set(NODES)
    assert info.parameters["controller"]["law"] == LAWS[namespace]
    tellers = [
        MessageTypes().deserialize(message.data, message.type).status[0].values
        for message in read_messages(folder / namespace, ("/diagnostics",))
    ]
    laws = {pair.value for values in tellers for pair in values if pair.key == "law"}
    assert laws == {LAWS[namespace]}


def test_a_graph_beside_another_has_the_bits_of_one_alone(folder: Path) -> None:
    values = {"common": {"schedule": str(folder / "schedule.yaml")}, "controller": {"law": "nmpc"}}
    assert (
        read_run(folder / "one").joint_position.tobytes()
        == simulate(load_scenario(values=values)).joint_position.tobytes()
    )


def test_a_viewer_in_a_namespace_shows_what_is_played_there(folder: Path, tmp_path: Path) -> None:
    """Of the bag of the other graph, which is played at the same time, it shows nothing."""
    rules = ("--ros-args", "--remap", "__ns:=/one")
    quiet = ("-p", "port:=0", "-p", "browser:=false", "-p", "frame_rate:=50.0")
    with running(*rules, *quiet, cwd=tmp_path, module="sms_handover.nodes.viewer") as viewer:
        viewer.until(lambda: "shown at" in viewer.text, "the address")
        address = viewer.text.partition("shown at ")[2].split()[0]
        for namespace, rate in (("two", 1.0), ("one", 0.1)):  # slowly: it learns of the arms on the way
            with running("bag", "play", folder / namespace, "--rate", rate, cwd=tmp_path) as player:
                assert player.end() == 0, player.text
        with urllib.request.urlopen(f"{address}{STREAM}", timeout=60.0) as stream:
            line = next(line for line in stream if line.startswith(b"data: ") and b"bodies" in line)
    shown = json.loads(line.removeprefix(b"data: "))
    run = read_run(folder / "one")
    places = poses(shown, len(shown["bodies"]))[:, shown["bodies"].index("arm_a_tool"), :3]
    periods = np.searchsorted(run.reference_ns, np.round(times(shown) * NS_PER_S))
    assert periods.size
    assert np.abs(places - run.tool_pose["arm_a"][periods, :3]).max() < 1e-6  # m, drawn in single precision
