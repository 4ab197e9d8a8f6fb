"""Parameters on a real node: defaults from ``config/``, refused like anywhere else, described to tools."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import pytest
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from sms_handover.bag.parameters import RecorderParameters
from sms_handover.configuration.package_files import config_file
from sms_handover.configuration.parameters import EVERY_NODE, build, parameter, read_parameter_files
from sms_handover.control.parameters import ControllerParameters
from sms_handover.errors import ConfigurationError, UnknownNameError
from sms_handover.graph.topics import CONTROLLER, IK, PLANT, RECORDER, TRAJECTORY
from sms_handover.ik.parameters import IkParameters
from sms_handover.plant.parameters import PlantParameters
from sms_handover.ros.parameters import as_arguments, declare, reject_unknown
from sms_handover.simulation.parameters import CommonParameters
from sms_handover.simulation.scenario import load_parameters
from sms_handover.trajectory.parameters import TrajectoryParameters

from .bench import Bench

pytestmark = pytest.mark.ros

GROUPS: dict[str, type[Any]] = {
    PLANT: PlantParameters,
    TRAJECTORY: TrajectoryParameters,
    IK: IkParameters,
    CONTROLLER: ControllerParameters,
    RECORDER: RecorderParameters,
}


def node_of(bench: Bench, name: str = CONTROLLER) -> Node:
    """Return a node that takes whatever parameters it is given, as those of the graph do."""
    return bench.add(lambda: Node(name, automatically_declare_parameters_from_overrides=True))


def controller(bench: Bench, **values: object) -> ControllerParameters:
    """Return the parameters of a controller that was given some."""
    bench.start({CONTROLLER: values})
    return declare(node_of(bench), ControllerParameters, "controller.yaml", CONTROLLER)


@pytest.mark.parametrize("name", list(GROUPS))
def test_defaults_are_those_of_the_files(bench: Bench, name: str) -> None:
    bench.start()
    node = node_of(bench, name)
    declared = declare(node, GROUPS[name], f"{name}.yaml", name)
    common = declare(node, CommonParameters, "common.yaml", EVERY_NODE)
    shipped = read_parameter_files([config_file(f"{name}.yaml")], name)
    assert declared == build(GROUPS[name], shipped, name)
    assert common == load_parameters().common
    if name != RECORDER:
        assert declared == getattr(load_parameters(), name)
    reject_unknown(node, CommonParameters, GROUPS[name])


def test_what_is_given_comes_on_top(bench: Bench) -> None:
    given = controller(bench, law="pid", proportional=2.5, control_order=3)
    shipped = load_parameters().controller
    assert (given.law, given.proportional, given.control_order) == ("pid", 2.5, 3)
    assert (given.integral, given.derivative) == (shipped.integral, shipped.derivative)


def test_a_whole_number_will_do_where_a_number_is_asked_for(bench: Bench) -> None:
    given = controller(bench, proportional=3)
    assert given.proportional == 3.0 and isinstance(given.proportional, float)


def test_parameters_of_other_nodes_are_not_taken(bench: Bench) -> None:
    bench.start({PLANT: {"law": "pid"}})
    node = node_of(bench)
    assert declare(node, ControllerParameters, "controller.yaml", CONTROLLER).law == "nmpc"
    reject_unknown(node, ControllerParameters)


REFUSED: dict[str, tuple[dict[str, object], str]] = {
    "below": (
        {"proportional": -1.5},
        "controller: parameter 'proportional' is -1.5 N m/rad, must be >=",
    ),
    "above": ({"control_order": 9}, "controller: parameter 'control_order' is 9, must be >= 0 and <= 3"),
    "whole number below": ({"control_order": -1}, "parameter 'control_order' is -1, must be >= 0 and <= 3"),
    "text for a number": ({"derivative": "much"}, "'derivative' is 'much', must be a number in N m s/rad"),
    "truth for a number": ({"integral": True}, "'integral' is True, must be a number in N m/(rad s)"),
    "fraction for a whole number": (
        {"control_order": 1.5},
        "'control_order' is 1.5, must be a whole number",
    ),
    "number for a text": ({"law": 3}, "'law' is 3, must be text"),
    "list for a number": ({"proportional": [1.0, 2.0]}, "'proportional' is"),
    "too small": ({"rolling_period": 0.0}, "'rolling_period' is 0.0 s, must be >= 0.001 s"),
}


@pytest.mark.parametrize("case", list(REFUSED))
def test_bad_values_are_refused(bench: Bench, case: str) -> None:
    values, text = REFUSED[case]
    with pytest.raises(ConfigurationError) as caught:
        controller(bench, **values)
    message = str(caught.value)
    assert text in message
    assert message.startswith("controller: parameter ")
    assert "\n" not in message


def test_a_value_that_is_not_finite_is_refused(bench: Bench) -> None:
    bench.start()
    node = bench.add(
        lambda: Node(
            CONTROLLER,
            automatically_declare_parameters_from_overrides=True,
            parameter_overrides=[Parameter("derivative", value=float("nan"))],
        )
    )
    with pytest.raises(ConfigurationError, match="'derivative' is nan N m s/rad, must be finite"):
        declare(node, ControllerParameters, "controller.yaml", CONTROLLER)


@pytest.mark.parametrize("values", [{"tick": 5.0}, {"tick": 0.0}, {"duration": -1.0}, {"mode": "fast"}])
def test_bad_common_values_are_refused(bench: Bench, values: dict[str, object]) -> None:
    bench.start({"common": values})
    name, value = next(iter(values.items()))
    with pytest.raises(ConfigurationError, match=f"plant: parameter '{name}'.*{value}.*(must be|known are)"):
        declare(node_of(bench, PLANT), CommonParameters, "common.yaml", EVERY_NODE)


def test_values_that_do_not_fit_each_other_are_refused(bench: Bench) -> None:
    bench.start({"common": {"tick": 0.003}})
    with pytest.raises(
        ConfigurationError, match=r"reference_period is 0.02 s, must be a multiple of the tick"
    ):
        declare(node_of(bench), CommonParameters, "common.yaml", EVERY_NODE)


def test_an_unknown_parameter_is_refused_with_the_nearest_name(bench: Bench) -> None:
    bench.start({CONTROLLER: {"proportionl": 1.0}})
    node = node_of(bench)
    declare(node, ControllerParameters, "controller.yaml", CONTROLLER)
    with pytest.raises(UnknownNameError) as caught:
        reject_unknown(node, ControllerParameters)
    assert "controller: unknown parameter 'proportionl' (did you mean 'proportional'?)" in str(caught.value)


def test_parameters_of_ros_itself_are_not_unknown(bench: Bench) -> None:
    bench.start({CONTROLLER: {"use_sim_time": False}})
    node = node_of(bench)
    declare(node, ControllerParameters, "controller.yaml", CONTROLLER)
    reject_unknown(node, ControllerParameters)


@pytest.mark.parametrize("name", list(GROUPS))
@pytest.mark.parametrize("given", [False, True])
def test_every_parameter_is_described(bench: Bench, name: str, given: bool) -> None:
    """Unit and meaning, range and choices, whether its value was given or is the default."""
    shipped = read_parameter_files([config_file(f"{name}.yaml")], name)
    bench.start({name: shipped} if given else {})
    node = node_of(bench, name)
    declare(node, GROUPS[name], f"{name}.yaml", name)
    for item in fields(GROUPS[name]):
        spec = item.metadata["sms_handover.spec"]
        descriptor: ParameterDescriptor = node.describe_parameter(item.name)
        assert descriptor.read_only
        assert descriptor.description.startswith(spec.description)
        assert descriptor.description.endswith(f"[{spec.unit}]" if spec.unit else spec.description)
        assert descriptor.additional_constraints == " | ".join(spec.choices)
        ranges = [*descriptor.floating_point_range, *descriptor.integer_range]
        assert len(ranges) == (spec.minimum is not None or spec.maximum is not None)
        if spec.minimum is not None:
            assert ranges[0].from_value == spec.minimum
        if spec.maximum is not None:
            assert ranges[0].to_value == spec.maximum


def test_a_running_node_keeps_its_parameters(bench: Bench) -> None:
    bench.start()
    node = node_of(bench)
    declare(node, ControllerParameters, "controller.yaml", CONTROLLER)
    for name, value in (("law", "pid"), ("proportional", 3.0)):
        before = node.get_parameter(name).value
        (result,) = node.set_parameters([Parameter(name, value=value)])
        assert not result.successful
        assert node.get_parameter(name).value == before


@dataclass(frozen=True)
class Sample:
    """One parameter of every kind."""

    number: float = parameter("a number")
    count: int = parameter("a count")
    text: str = parameter("a text")
    switch: bool = parameter("a switch")
    numbers: tuple[float, ...] = parameter("numbers")
    texts: tuple[str, ...] = parameter("texts")


AWKWARD: dict[str, tuple[object, ...]] = {
    "number": (0.1, 1e-10, -1e300, 1.0, 1e22, 2.3e-308, 2.0 / 3.0),
    "count": (0, -3, 2**62),
    "text": ("", "yes", "3", "1e-3", "it's", "a: b", "ä #%&", "~", "[x]", "/a b/c.yaml"),
    "switch": (True, False),
    "numbers": ((1.0, 1e-7, -2.5),),
    "texts": (("a", "it's", "1.0"), ("true",)),
}


@pytest.mark.parametrize(("name", "value"), [(name, v) for name, values in AWKWARD.items() for v in values])
def test_arguments_arrive_as_they_were(bench: Bench, name: str, value: object) -> None:
    """What the launcher writes on a node's command line is what the node reads, bit for bit."""
    plain = {"number": 0.0, "count": 0, "text": "x", "switch": False, "numbers": (0.0,), "texts": ("x",)}
    bench.start({"common": {**plain, name: value}})
    node = node_of(bench)
    values = {item.name: node.get_parameter(item.name).value for item in fields(Sample)}
    values = {key: list(v) if not isinstance(v, str | int | float) else v for key, v in values.items()}
    read = getattr(build(Sample, values, "here"), name)
    assert repr(read) == repr(value)


def test_paths_are_written_as_text() -> None:
    assert as_arguments({"folder": Path("/a b/it's"), "x": 1}) == ["-p", "folder:='/a b/it''s'", "-p", "x:=1"]


def test_nothing_changes_while_a_node_runs(bench: Bench) -> None:
    """Not the parameter of ROS itself either, which would stop the timers."""
    controller(bench)
    (node,) = bench._nodes
    reject_unknown(node, ControllerParameters)
    for change in (Parameter("use_sim_time", value=True), Parameter("law", value="pid")):
        (result,) = node.set_parameters([change])
        assert not result.successful and change.name in result.reason


def test_simulated_time_is_refused(bench: Bench) -> None:
    bench.start({CONTROLLER: {"use_sim_time": True}})
    with pytest.raises(ConfigurationError, match="'use_sim_time' is true, must be false"):
        reject_unknown(node_of(bench))
