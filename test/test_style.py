"""What the ament linters ask of a package, as tests: flake8 and pep257 by ruff, copyright, xmllint.

They need nothing of ROS, so ``colcon test`` can run them too; docs/ros2.md has the command, and compares
them with the linters.
"""

import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

import pytest

from .workspace import ROOT

pytestmark = pytest.mark.linter

LICENCE = "BSD-3-Clause"
PACKAGES = (ROOT, ROOT / "interfaces", ROOT / "interfaces_tf2", ROOT / "examples" / "my_controller")
XML = sorted(
    path
    for pattern in ("*.xml", "*/package.xml", "examples/*/package.xml", "config/**/*.xml")
    for path in ROOT.glob(pattern)
)
SCHEMA = "http://download.ros.org/schema/package_format3.xsd"

# The elements of a package.xml of format 3 [REP 149].
NEEDED = ("name", "version", "description", "maintainer", "license")
ELEMENTS = {
    *NEEDED,
    *[
        "url",
        "author",
        "build_depend",
        "build_export_depend",
        "buildtool_depend",
        "buildtool_export_depend",
        "exec_depend",
    ],
    *[
        "depend",
        "doc_depend",
        "test_depend",
        "conflict",
        "replace",
        "group_depend",
        "member_of_group",
        "export",
    ],
}

# Every key in use, as found in rosdep/python.yaml, and among the packages of jazzy/distribution.yaml, of
# ros/rosdistro at 8468e88ccd (22 August 2026). Look a new one up there before it is added.
IN_ROSDEP = set(
    [
        "mcap-ros2-support",
        "python3-jinja2",
        "python3-matplotlib",
        "python3-numpy",
        "python3-pytest",
        "python3-rich",
        "python3-rosbags-pip",
        "python3-yaml",
    ]
)
IN_JAZZY = set(
    [
        "ament_cmake",
        "builtin_interfaces",
        "coal",
        "diagnostic_msgs",
        "eigenpy",
        "geometry_msgs",
        "launch",
        "launch_ros",
        "lifecycle_msgs",
        "nav_msgs",
        "pinocchio",
        "rcl_interfaces",
        "rclpy",
        "ros2launch",
        "rosgraph_msgs",
        "rosidl_default_generators",
        "rosidl_default_runtime",
        "sensor_msgs",
        "std_msgs",
        "std_srvs",
        "tf2_msgs",
        "visualization_msgs",
    ]
)
OURS = {"sms_handover", "sms_handover_interfaces"}

COPYRIGHT = re.compile(r"copyright\s*(\(c\)|©|\d{4})|SPDX-License-Identifier", re.IGNORECASE)


def short(path: Path) -> str:
    return str(path.relative_to(ROOT))


@pytest.mark.parametrize("arguments", [("check",), ("format", "--check")], ids=" ".join)
def test_flake8_and_pep257(arguments: tuple[str, ...]) -> None:
    """E, F, W, I of flake8 and more, and D of pydocstyle, as pyproject.toml sets them."""
    if find_spec("ruff") is None:
        pytest.skip("ruff is not installed here: pip install ruff")
    done = subprocess.run(
        [sys.executable, "-m", "ruff", *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("path", XML, ids=short)
def test_xmllint(path: Path) -> None:
    ElementTree.parse(path)


@pytest.mark.parametrize("package", PACKAGES, ids=short)
def test_a_package_manifest_is_of_format_3(package: Path) -> None:
    """The elements that the schema wants, no other, each kind in one place."""
    path = package / "package.xml"
    assert f'href="{SCHEMA}"' in path.read_text(encoding="utf-8")
    root = ElementTree.parse(path).getroot()
    assert (root.tag, root.get("format")) == ("package", "3")
    tags = [element.tag for element in root]
    assert set(NEEDED) <= set(tags) <= ELEMENTS
    assert [tags.count(name) for name in ("name", "version", "description")] == [1, 1, 1]
    assert tags[: len(NEEDED)] == list(NEEDED) and tags[-1] == "export"


@pytest.mark.parametrize("package", PACKAGES, ids=short)
def test_every_dependency_is_a_rosdep_key_or_ours(package: Path) -> None:
    root = ElementTree.parse(package / "package.xml").getroot()
    keys = {element.text for element in root if element.tag.endswith("depend")}
    assert keys <= IN_ROSDEP | IN_JAZZY | OURS


@pytest.mark.parametrize("package", PACKAGES, ids=short)
def test_every_package_names_the_licence(package: Path) -> None:
    root = ElementTree.parse(package / "package.xml").getroot()
    assert root.findtext("license") == LICENCE
    files = [package / name for name in ("setup.py", "pyproject.toml")]
    told = "".join(path.read_text(encoding="utf-8") for path in files if path.is_file())
    assert re.search(rf'license ?= ?"{LICENCE}"', told)


def test_the_licence_stands_once() -> None:
    """In ``LICENSE``, and in no file of ours at its head; what is not ours has its own beside it."""
    text = (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert text.startswith("BSD 3-Clause License") and "Neither the name of" in text
    files = [
        path for folder in ("sms_handover", "examples", "launch") for path in (ROOT / folder).rglob("*.py")
    ]
    assert [short(path) for path in files if COPYRIGHT.search(path.read_text(encoding="utf-8"))] == []
    foreign = [path for path in (ROOT / "sms_handover").rglob("*.min.js")]
    assert foreign
    for path in foreign:
        assert path.with_name(path.name.replace(".min.js", ".LICENSE.txt")).is_file(), path
