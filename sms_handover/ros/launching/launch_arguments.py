"""Launch arguments of ``ros2 launch sms_handover handover.launch.py``, which set parameters of the nodes.

An argument that is not given leaves its parameter to the parameter file of the user, then to ``config/``.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from sms_handover.configuration.field_specification import ValueSpec
from sms_handover.configuration.parameters import specs_of
from sms_handover.errors import ConfigurationError
from sms_handover.graph.topics import CONTROLLER, RECORDER, TRAJECTORY
from sms_handover.ros.launching.composition import ProcessArguments, nodes_together, placed, process_arguments
from sms_handover.ros.reference.interfaces import COMMON_GROUP, OWN_GROUPS, ParameterGroup
from sms_handover.simulation.parameters import LOCKSTEP

_EVERY_NODE = ""
_COMMON = (
    "scenario",
    "schedule",
    "robot",
    "conditions",
    "duration",
    "mode",
    "dynamics",
    "external",
    "autostart",
)
_TRUE = "true"


@dataclass(frozen=True)
class LaunchArgument:
    """An argument that sets one parameter, of one node or of all."""

    node: str
    parameter: str

    @property
    def group(self) -> ParameterGroup:
        """The parameters that this one belongs to."""
        return COMMON_GROUP if self.node == _EVERY_NODE else OWN_GROUPS[self.node]

    @property
    def spec(self) -> ValueSpec:
        """Unit, range and description of the parameter."""
        return specs_of(self.group.cls)[self.parameter]

    @property
    def text(self) -> str:
        """The description in ``--show-args``."""
        unit = f" [{self.spec.unit}]" if self.spec.unit else ""
        return f"{self.spec.description}{unit}; not given: as in params_file, else config/{self.group.file}"

    @property
    def choices(self) -> list[str] | None:
        """The values allowed, with '' for not given; None if there is no such list."""
        if self.spec.kind is bool:
            return ["", _TRUE, "false"]
        return ["", *self.spec.choices] if self.spec.choices else None


ARGUMENTS = {
    "controller": LaunchArgument(CONTROLLER, "law"),
    "time_law": LaunchArgument(TRAJECTORY, "time_law"),
    "bag": LaunchArgument(RECORDER, "folder"),
    **{name: LaunchArgument(_EVERY_NODE, name) for name in _COMMON},
}


def launch_processes(given: Mapping[str, str], *, record: bool, compose: bool) -> dict[str, ProcessArguments]:
    """Return the processes to start, each with the arguments that the launch arguments make.

    ``given`` may hold other launch arguments too; '' is one that was not given. Its ``nodes`` names the
    nodes of this host, with commas between. Raises ConfigurationError on a number that is none.
    """
    here, _ = placed(given.get("nodes", ""), record=record)
    values: dict[str, dict[str, object]] = {}
    for name, argument in ARGUMENTS.items():
        if given.get(name):
            of_node = values.setdefault(argument.node, {})
            of_node[argument.parameter] = _typed(argument, name, given[name])
    files = [given["params_file"]] if given.get("params_file") else []
    together = nodes_together(given.get("mode") or LOCKSTEP) if compose else ()
    common = values.get(_EVERY_NODE, {})
    processes = process_arguments(common, values, files, record=record, together=together, here=here)
    return {name: arguments for name, arguments in processes.items() if name != given.get("external")}


def _typed(argument: LaunchArgument, name: str, text: str) -> object:
    """Return the text of an argument as its parameter is typed."""
    hint = argument.spec.kind
    if hint == tuple[str, ...]:
        return (text,)
    if hint is bool:
        return text == _TRUE
    if hint is not float:
        return text
    try:
        return float(text)
    except ValueError:
        raise ConfigurationError(
            f"launch argument {name!r} is {text!r}, expected a number {argument.spec.unit}"
        ) from None
