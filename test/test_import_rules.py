"""Imports point one way: edge -> simulation -> {plant, trajectory, ik, control} -> model -> foundation.

``conditions`` lies between plant and model.

``compiled``, which stands in for Pinocchio in plant, ik and control, lies between simulation and those.

Read from the syntax trees, so an import inside a function or for type checking alone counts too.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = "sms_handover"
ROOT = Path(__file__).resolve().parent.parent
FILES = sorted((ROOT / PACKAGE).rglob("*.py"))

FOUNDATION = "foundation"
FRONT_DOOR = "front door"  # the names of sms_handover itself, imported when they are used
FOUNDATION_MODULES = {
    *("types", "errors", "units", "frames", "run_data", "plan_report", "previewed_targets"),
    "process_status",  # of processes that campaigns and the launcher start
}
FOUNDATION_ROOMS = {"configuration", "graph"}  # known to all; configuration knows the names of the graph too
MIDDLE = {"plant", "trajectory", "ik", "control"}
CORE = {
    "messages",
    "model",
    "conditions",
    *MIDDLE,
    "clearance",
    "compiled",
    "simulation",
    "bag",
    "analysis",
    "engines",
    "scene",
    "playback",
    "report",
    "export",
    "terminal",
    "campaign",
}
EDGE = {"ros", "nodes", "external", "launcher", "cli"}

# What a layer may import besides itself and the foundation.
ALLOWED: dict[str, set[str]] = {
    FOUNDATION: FOUNDATION_ROOMS,
    "configuration": {"graph"},
    "graph": set(),
    "messages": set(),
    "terminal": set(),
    "model": set(),
    "conditions": {"model"},
    **{layer: {"model"} for layer in MIDDLE - {"plant"}},
    "plant": {"model", "conditions"},
    "clearance": {"model"},
    "compiled": {"model", "conditions", *MIDDLE},
    "simulation": {"model", "conditions", *MIDDLE, "compiled", "clearance"},
    "bag": {"messages", "model", "simulation"},
    "analysis": {"model", "trajectory", "clearance", "simulation", "bag", "scene"},
    "engines": {"model", "conditions", "plant", "simulation", "analysis"},
    "scene": {"messages", "model", "trajectory", "clearance", "bag"},
    "playback": {"messages", "bag"},
    "export": {"messages", "model", "clearance", "bag"},
    "report": {"plant", "clearance", "bag", "analysis", "engines", "scene"},
    "campaign": {"conditions", "model", "control", "trajectory", "simulation", "bag", "analysis", "report"},
    "ros": CORE,
    "nodes": CORE | {"ros"},
    "external": CORE | {"ros", "nodes"},
    "launcher": CORE | {"ros"},
    "cli": CORE | {"ros", "nodes", "launcher"},
    FRONT_DOOR: CORE | {"external"},
}
FIGURES = "sms_handover.analysis.figures"
OPTIONAL = {
    "matplotlib": FIGURES,
    "mpl_toolkits": FIGURES,
    "casadi": "sms_handover.compiled",
    "mujoco": "sms_handover.engines",
    "Basilisk": "sms_handover.engines",
    "daqp": "sms_handover.control.mpc",
    "distributed": "sms_handover.campaign.engine",
}  # who needs them
ROS = re.compile(r"rclpy|ament_index_python|launch(_ros)?|tf2_\w+|rosidl_\w+|\w+_(msgs|srvs|interfaces)")


def layer_of(module: str) -> str:
    """Return the layer of a module of the package, or raise ValueError where it has none."""
    head = module.split(".")[1] if "." in module else "__init__"
    if head == "__init__":
        return FRONT_DOOR
    if head in FOUNDATION_MODULES:
        return FOUNDATION
    if head in ALLOWED:
        return head
    raise ValueError(f"{module} belongs to no layer")


def module_of(file: Path) -> str:
    """Return the dotted name of a file of the package."""
    return ".".join(file.relative_to(ROOT).with_suffix("").parts)


def imported_names(tree: ast.AST, module: str) -> Iterator[tuple[int, str]]:
    """Yield the line and the full dotted name of everything a module imports.

    ``module`` names a file, ``sms_handover.plant.__init__`` for that of a package.
    """
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = module.split(".")[: -node.level] if node.level else []
            source = ".".join([*base, *([node.module] if node.module else [])])
            yield from ((node.lineno, f"{source}.{alias.name}") for alias in node.names)


def violations(source: str, module: str) -> list[str]:
    """Name every import of a module that points the wrong way."""
    layer = layer_of(module)
    found = []
    for line, name in imported_names(ast.parse(source), module):
        head, *rest = name.split(".")
        if ROS.fullmatch(head) and layer not in EDGE:
            found.append(f"{module}:{line} imports {name}: only {sorted(EDGE)} may know ROS")
        if head in OPTIONAL and not module.startswith(f"{OPTIONAL[head]}."):
            found.append(f"{module}:{line} imports {name}: only {OPTIONAL[head]} may")
        if head != PACKAGE or not rest or rest[0].startswith("__"):
            continue
        target = layer_of(name)
        rooms = set() if layer in {FOUNDATION, *FOUNDATION_ROOMS} else FOUNDATION_ROOMS
        if target not in {layer, FOUNDATION, *rooms, *ALLOWED[layer]}:
            found.append(f"{module}:{line} imports {name}: {layer} may not know {target}")
    return found


@pytest.mark.parametrize("file", FILES, ids=module_of)
def test_imports_point_one_way(file: Path) -> None:
    assert violations(file.read_text(encoding="utf-8"), module_of(file)) == []


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("sms_handover.units", "from sms_handover.model.poses import pose_of"),
        ("sms_handover.model.urdf", "import sms_handover.plant.deputy"),
        ("sms_handover.plant.deputy", "from sms_handover.control import base"),
        ("sms_handover.ik.residual", "from sms_handover import trajectory"),
        ("sms_handover.ik.residual", "from ..trajectory import schedule"),
        ("sms_handover.control.__init__", "from ..plant import deputy"),
        ("sms_handover.control.pid", "def law():\n    from sms_handover.simulation import loop"),
        ("sms_handover.bag.writer", "from sms_handover.analysis import metrics"),
        ("sms_handover.analysis.metrics", "from sms_handover.ros import qos"),
        ("sms_handover.ros.qos", "from sms_handover.nodes import plant"),
        ("sms_handover.nodes.plant", "from sms_handover.cli import main"),
        ("sms_handover.nodes.plant", "from sms_handover.external.controller import run_controller"),
        ("sms_handover.simulation.loop", "import rclpy"),
        ("sms_handover.bag.writer", "from sensor_msgs.msg import JointState"),
        ("sms_handover.graph.topics", "from std_srvs.srv import Trigger"),
        ("sms_handover.ik.residual", "import sms_handover_interfaces.srv"),
        ("sms_handover.analysis.metrics", "from matplotlib.figure import Figure"),
        ("sms_handover.cli.figure_files", "def draw():\n    import mpl_toolkits.mplot3d"),
        ("sms_handover.control.nmpc", "import casadi"),
        ("sms_handover.campaign.record.journal", "import distributed"),
        ("sms_handover.simulation.loop", "from sms_handover.campaign.cases import case"),
        ("sms_handover.compiled.step", "from sms_handover.simulation import loop"),
        ("sms_handover.__init__", "from sms_handover.nodes.plant import main"),
    ],
)
def test_a_wrong_import_is_caught(module: str, source: str) -> None:
    assert len(violations(source, module)) == 1


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("sms_handover.plant.deputy", "from sms_handover import __version__, types"),
        ("sms_handover.plant.deputy", "from . import grasping"),
        ("sms_handover.plant.__init__", "from .deputy import Deputy"),
        ("sms_handover.simulation.loop", "from sms_handover.plant import deputy"),
        ("sms_handover.nodes.plant", "import rclpy\nfrom sms_handover_interfaces.msg import RunState"),
        ("sms_handover.bag.run.reader", "import rosbags.rosbag2"),
        ("sms_handover.analysis.figures.time_series", "from matplotlib.figure import Figure"),
        ("sms_handover.__init__", "from sms_handover.simulation.loop import Loop as Loop"),
    ],
)
def test_a_right_import_passes(module: str, source: str) -> None:
    assert violations(source, module) == []


def test_the_front_door_is_for_users() -> None:
    """What a module of the package needs it takes from where it is made."""
    with pytest.raises(ValueError, match=r"sms_handover\.Loop belongs to no layer"):
        violations("from sms_handover import Loop", "sms_handover.report.page")


def test_a_module_without_a_layer_is_caught() -> None:
    with pytest.raises(ValueError, match=r"sms_handover\.helpers belongs to no layer"):
        violations("", "sms_handover.helpers")
