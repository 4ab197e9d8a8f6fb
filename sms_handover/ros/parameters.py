"""Parameters of a node: a dataclass is declared as such and read back."""

from collections.abc import Mapping
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from sms_handover.configuration.field_specification import ValueSpec
from sms_handover.configuration.package_files import config_file
from sms_handover.configuration.parameters import (
    EVERY_NODE,
    build,
    defaults_of,
    read_parameter_files,
    specs_of,
)
from sms_handover.configuration.scenario_file import ScenarioFile, load_scenario_file
from sms_handover.errors import ConfigurationError, UnknownNameError

T = TypeVar("T")

_LARGEST = 1.7976931348623157e308  # [-] stands for "no upper bound" in a range message
_LARGEST_INT = 2**63 - 1  # [-]
_SCENARIO = "scenario"
_SIMULATED_TIME = "use_sim_time"
_ROS_OWN = (_SIMULATED_TIME, "start_type_description_service")


def named_scenario(node: Node) -> ScenarioFile:
    """Return the scenario that a node was given, by default the shipped one; raises ConfigurationError."""
    name = read_parameter_files([config_file("common.yaml")], EVERY_NODE)[_SCENARIO]
    if node.has_parameter(_SCENARIO):
        name = node.get_parameter(_SCENARIO).value
    return load_scenario_file(str(name))


def declare(
    node: Node, cls: type[T], file: str | None, section: str, scenario: Mapping[str, object] | None = None
) -> T:
    """Declare the fields of ``cls`` as read-only parameters of ``node`` and return them checked.

    The defaults are those of the fields, then of a section of a file in the package's ``config/`` if there is
    one, then of a ``scenario``; what was given on the command line comes on top. Raises ConfigurationError.
    """
    values = defaults_of(cls)
    if file is not None:
        values.update(read_parameter_files([config_file(file)], section))
    values.update(scenario or {})
    specs = specs_of(cls)
    given = [name for name in specs if node.has_parameter(name)]
    values.update({name: node.get_parameter(name).value for name in given})
    checked = build(cls, values, node.get_name())  # before ROS checks the range with errors of its own
    for name, spec in specs.items():
        if name in given:
            node.set_descriptor(name, _descriptor(spec))
        else:
            node.declare_parameter(name, values[name], _descriptor(spec))
    return checked


def reject_unknown(node: Node, *groups: type[object]) -> None:
    """Raise UnknownNameError on a parameter that no group has; reject changes from now on."""
    known = [item.name for cls in groups for item in fields(cls)]  # type: ignore[arg-type]
    for name in node.get_parameters_by_prefix(""):
        if name not in known and not name.startswith((*_ROS_OWN, "qos_overrides.")):
            raise UnknownNameError("parameter", name, known, node.get_name())
    if node.has_parameter(_SIMULATED_TIME) and node.get_parameter(_SIMULATED_TIME).value:
        raise ConfigurationError(
            f"{node.get_name()}: parameter {_SIMULATED_TIME!r} is true, must be false: the node has no clock"
        )
    node.add_on_set_parameters_callback(partial(_reject_change, node))


def _reject_change(node: Node, parameters: list[Parameter]) -> SetParametersResult:
    """Reject changes of parameters that a node has: a run is made with those in its bag."""
    names = ", ".join(parameter.name for parameter in parameters if node.has_parameter(parameter.name))
    return SetParametersResult(successful=not names, reason=f"{names}: set it when the node is started")


def as_arguments(values: Mapping[str, object], node: str = "") -> list[str]:
    """Return command-line arguments that set parameters: ``-p name:=value`` of every node of a process.

    With ``node`` they are those of one node of the process: ``-p node:name:=value``. A list without
    entries is left out: ROS cannot read one, and every list of this package is empty unless it is given.
    """
    of = f"{node}:" if node else ""
    said = {name: value for name, value in values.items() if value not in ([], ())}
    return [part for name, value in said.items() for part in ("-p", f"{of}{name}:={_yaml(value)}")]


def _yaml(value: object) -> str:
    """Return a value as YAML that reads back as the same type."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_yaml(item) for item in value) + "]"
    if isinstance(value, str | Path):
        return "'" + str(value).replace("'", "''") + "'"
    if isinstance(value, float):
        text = repr(value)
        return text if "." in text or "e" not in text else text.replace("e", ".0e")
    return repr(value)


def _descriptor(spec: ValueSpec) -> ParameterDescriptor:
    """Return what ``ros2 param describe`` shows of a parameter."""
    unit = f" [{spec.unit}]" if spec.unit else ""
    descriptor = ParameterDescriptor(
        description=spec.description + unit,
        additional_constraints=" | ".join(spec.choices),
        read_only=True,
        dynamic_typing=True,
    )
    if spec.minimum is not None or spec.maximum is not None:
        low = -_LARGEST if spec.minimum is None else spec.minimum
        high = _LARGEST if spec.maximum is None else spec.maximum
        if spec.kind is float:
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=float(low), to_value=float(high))
            ]
        if spec.kind is int:
            top = _LARGEST_INT if spec.maximum is None else int(high)
            descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=top)]
    return descriptor
