"""The recorder learns every parameter of the nodes it waits for, whenever they appear."""

from typing import Any

import pytest
from rclpy.client import Client
from rclpy.node import Node
from rclpy.task import Future

from sms_handover.bag.attachments import parameters_from_json, parameters_json
from sms_handover.nodes.parts.peer_parameters import PeerParameters

from .bench import Bench

pytestmark = pytest.mark.ros

VALUES: dict[str, dict[str, Any]] = {
    "plant": {"number": 0.1, "count": -3, "text": "it's", "switch": True},
    "controller": {"numbers": [1.0, -0.5], "names": ["a", "b"], "counts": [1, 2], "switches": [True, False]},
}


def peer(bench: Bench, name: str) -> Node:
    """Return a node with its made-up parameters."""
    node = bench.add(lambda: Node(name))
    for key, value in VALUES[name].items():
        node.declare_parameter(key, value)
    return node


def own(values: dict[str, object]) -> dict[str, object]:
    """Return parameters without those of ROS itself."""
    return {k: v for k, v in values.items() if k not in ("use_sim_time", "start_type_description_service")}


def test_every_value_comes_as_plain_python(bench: Bench) -> None:
    bench.start()
    peers = PeerParameters(bench.plain("recorder"), ("plant", "controller"))
    for name in VALUES:
        peer(bench, name)
    bench.until(peers.poll, "the parameters")
    assert {name: own(values) for name, values in peers.values.items()} == VALUES
    types = {type(value) for values in peers.values.values() for value in values.values()}
    assert types <= {float, int, str, bool, list}
    assert parameters_from_json(parameters_json(peers.values)) == peers.values


def test_a_node_that_is_not_there_is_waited_for(bench: Bench) -> None:
    bench.start()
    peers = PeerParameters(bench.plain("recorder"), ("plant", "controller"))
    assert not peers.poll()
    peer(bench, "plant")
    bench.until(lambda: peers.poll() or "plant" in peers.values, "the parameters of the first node")
    assert set(peers.values) == {"plant"}
    assert not peers.poll()
    peer(bench, "controller")
    bench.until(peers.poll, "the parameters of the second node")
    assert own(peers.values["controller"]) == VALUES["controller"]


def test_a_node_can_ask_itself(bench: Bench) -> None:
    bench.start()
    node = peer(bench, "plant")
    peers = PeerParameters(node, ("plant",))
    bench.until(peers.poll, "the parameters")
    assert own(peers.values["plant"]) == VALUES["plant"]


def test_a_node_whose_answer_is_lost_is_asked_again(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """A service drops an answer for one whom it has not found yet; nobody tells the one who waits for it."""
    bench.start()
    ask, asked = Client.call_async, []

    def lossy(client: Client, request: Any) -> Future:
        asked.append(client)
        return ask(client, request) if len(asked) > 1 else Future()

    monkeypatch.setattr(Client, "call_async", lossy)
    peer(bench, "plant")
    peers = PeerParameters(bench.plain("recorder"), ("plant",), ask_again_s=0.01)
    bench.until(peers.poll, "the parameters")
    assert own(peers.values["plant"]) == VALUES["plant"]
    assert len(asked) > 1
