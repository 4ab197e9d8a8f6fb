"""What a release must keep in step: versions, entry points, dependencies, pages written from the code."""

import ast
import re
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

import sms_handover
from docs.reference import pages
from sms_handover.configuration import package_files
from sms_handover.errors import ConfigurationError

from .workspace import ROOT, entry_points

# What package.xml calls what is imported here under another name: rosdep keys and ROS packages, as listed in
# rosdep/python.yaml and jazzy/distribution.yaml of ros/rosdistro. A module without a key of its own names one
# that brings it.
KEYS = {
    "coal": "coal",
    "eigenpy": "pinocchio",
    "jinja2": "python3-jinja2",
    "launch": "launch",
    "launch_ros": "launch_ros",
    "lz4": "mcap-ros2-support",
    "matplotlib": "python3-matplotlib",
    "mcap": "mcap-ros2-support",
    "mpl_toolkits": "python3-matplotlib",
    "numpy": "python3-numpy",
    "pinocchio": "pinocchio",
    "rich": "python3-rich",
    "rosbags": "python3-rosbags-pip",
    "yaml": "python3-yaml",
    "zstandard": "mcap-ros2-support",
}
# Extras that a user installs with pip: rosdep has no key for them.
BY_PIP_ONLY = {
    "Basilisk",
    "SALib",
    "casadi",
    "dask",
    "distributed",
    "mujoco",
    "pandas",
    "playwright",
    "plotly",
    "pyarrow",
    "scipy",
    "statsmodels",
}
ROS_PACKAGE = re.compile(r"rclpy|rosidl_\w+|ament_index_python|tf2_\w+|\w+_(msgs|srvs|interfaces)")


def declared_version(package_xml: Path) -> str | None:
    return ElementTree.parse(package_xml).findtext("version")


def imported_modules() -> Iterator[str]:
    """Yield the top-level name of every module that the package or its launch files import from elsewhere."""
    files = [*(ROOT / "sms_handover").rglob("*.py"), *(ROOT / "launch").glob("*.py")]
    for file in files:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                yield from (alias.name.partition(".")[0] for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                yield node.module.partition(".")[0]


PAGES = pages()
OUTSIDE = sorted(set(imported_modules()) - {"sms_handover"} - set(sys.stdlib_module_names))


def test_every_file_names_the_same_version() -> None:
    assert declared_version(ROOT / "package.xml") == sms_handover.__version__
    for folder in ("interfaces", "interfaces_tf2"):
        assert declared_version(ROOT / folder / "package.xml") == sms_handover.__version__
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == sms_handover.__version__


def test_every_executable_exists() -> None:
    entries = entry_points("USER_COMMANDS", "ROS_EXECUTABLES")
    assert {entry.split(" = ")[0] for entry in entries} >= {"sms-handover", "handover", "plant"}
    for entry in entries:
        module, function = entry.split(" = ")[1].split(":")
        spec = find_spec(module)
        assert spec is not None and spec.origin is not None, entry
        tree = ast.parse(Path(spec.origin).read_text(encoding="utf-8"))
        assert function in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}, entry


@pytest.mark.parametrize("module", OUTSIDE)
def test_what_is_imported_is_declared_to_rosdep(module: str) -> None:
    """``rosdep install`` must bring everything that the code imports."""
    if module in BY_PIP_ONLY:
        return
    key = module if ROS_PACKAGE.fullmatch(module) else KEYS.get(module)
    assert key is not None, f"{module} is imported, but KEYS in this file names no rosdep key for it"
    package = ElementTree.parse(ROOT / "package.xml").getroot()
    assert key in {item.text for tag in ("depend", "exec_depend") for item in package.findall(tag)}


@pytest.mark.parametrize("path", list(PAGES), ids=lambda path: path.name)
def test_a_reference_page_is_up_to_date(path: Path) -> None:
    """After a change of parameters, topics or services: ``make reference``."""
    assert path.read_text(encoding="utf-8") == PAGES[path], "run: make reference"


@pytest.mark.parametrize(
    ("package", "share"),
    [
        ("venv/lib/python3.11/site-packages", "venv/share"),
        ("target", "target/share"),
        ("clone", ""),
    ],
)
def test_config_is_found_where_pip_puts_it(
    package: str, share: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By itself, with --user and --prefix, and with --target; `.ci/wheel` tries it with pip."""
    home = tmp_path / share / "sms_handover" if share else tmp_path / package
    (home / "config").mkdir(parents=True)
    (home / "config" / "robot.yaml").touch()
    file = tmp_path / package / "sms_handover" / "configuration" / "package_files.py"
    monkeypatch.setattr(package_files, "__file__", str(file))
    monkeypatch.setattr("sysconfig.get_path", lambda name: "/nowhere")
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    assert package_files.share_directory() == home
    monkeypatch.setattr(package_files, "__file__", "/sms_handover/configuration/package_files.py")
    with pytest.raises(ConfigurationError, match="not installed; searched /, /nowhere/share/sms_handover"):
        package_files.share_directory()


def requirements() -> dict[str, list[str]]:
    """Return what setup.py requires, by extra; '' is what is always installed."""
    tree = ast.parse((ROOT / "setup.py").read_text(encoding="utf-8"))
    call = next(node for node in ast.walk(tree) if isinstance(node, ast.Call) and node.keywords)
    given = {keyword.arg: keyword.value for keyword in call.keywords}
    extras: dict[str, list[str]] = ast.literal_eval(given["extras_require"])
    return {"": ast.literal_eval(given["install_requires"]), **extras}


def test_the_lowest_versions_are_those_that_are_declared() -> None:
    """`make lowest` installs the lower bound of all that a user installs, but for the packages of ROS."""
    bounds = {
        extra: dict(re.split(">=|,", item)[:2] for item in items if ">=" in item and "ros-" not in item)
        for extra, items in requirements().items()
    }
    lines = (ROOT / ".ci" / "lowest.txt").read_text(encoding="utf-8").splitlines()
    lowest = dict(line.split("==") for line in lines if not line.startswith("#"))
    users = {
        name: bound
        for extra in ("", "analysis", "campaign", "compiled", "matlab", "pandas", "parquet")
        for name, bound in bounds[extra].items()
    }
    assert users.keys() <= lowest.keys()
    assert lowest == {name: {**bounds["test"], **users}[name] for name in lowest}
