"""What a release must keep in step: the version in every file, and entry points that exist."""

import ast
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

import sms_handover

ROOT = Path(__file__).resolve().parent.parent


def declared_version(package_xml: Path) -> str | None:
    return ElementTree.parse(package_xml).findtext("version")


def entry_points() -> list[str]:
    """Return every ``name = module:function`` that setup.py lists."""
    lists = {"USER_COMMANDS", "ROS_EXECUTABLES"}
    tree = ast.parse((ROOT / "setup.py").read_text(encoding="utf-8"))
    assignments = [node for node in tree.body if isinstance(node, ast.Assign)]
    found = [a for a in assignments if isinstance(a.targets[0], ast.Name) and a.targets[0].id in lists]
    return [entry for assignment in found for entry in ast.literal_eval(assignment.value)]


def test_every_file_names_the_same_version() -> None:
    assert declared_version(ROOT / "package.xml") == sms_handover.__version__
    assert declared_version(ROOT / "interfaces" / "package.xml") == sms_handover.__version__


def test_every_executable_exists() -> None:
    entries = entry_points()
    assert {entry.split(" = ")[0] for entry in entries} >= {"sms-handover", "handover", "plant"}
    for entry in entries:
        module, function = entry.split(" = ")[1].split(":")
        spec = find_spec(module)
        assert spec is not None and spec.origin is not None, entry
        tree = ast.parse(Path(spec.origin).read_text(encoding="utf-8"))
        assert function in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}, entry
