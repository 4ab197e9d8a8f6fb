"""The front door, ``import sms_handover as sms``: what it offers and costs; examples and pages use it."""

import ast
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import sms_handover as sms

from ..documents import DOCUMENTS, Block, blocks
from ..workspace import PACKAGE, ROOT

EXAMPLES = sorted((ROOT / "examples").rglob("*.py"))
SMALL_PACKAGE = ROOT / "examples" / "my_law"
MOST_LINES = 60  # of an outside package with a law
MOST_MODULES = 2  # imported for one task, besides the standard library
CODE = [
    *(block for path in DOCUMENTS for block in blocks(path) if block.language == "python"),
    *(Block(str(path.relative_to(ROOT)), "python", path.read_text("utf-8")) for path in EXAMPLES),
]
TASKS = {  # a task: where a user reads how to do it, and what that code calls
    "simulate": ("install.md", "simulate"),
    "own law": ("examples/my_law/my_law.py", "Law"),
    "read a bag": ("analysis.md", "read_run"),
    "compare": ("analysis.md", "compare"),
    "branch a run": ("tutorial_branching.md", "Loop"),
}


def offered() -> list[str]:
    """Return the names of the list."""
    tree = ast.parse((ROOT / PACKAGE / "__init__.py").read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    imports = [node for node in block.body if isinstance(node, ast.ImportFrom)]
    assert len(imports) == len(block.body)
    return [alias.asname or "" for node in imports for alias in node.names]


def imports(code: str) -> Iterator[str]:
    """Yield every module that code imports, but for those of the standard library."""
    for node in ast.walk(ast.parse(code)):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [node.module or ""]
        yield from (name for name in names if name.partition(".")[0] not in sys.stdlib_module_names)


def used(code: str) -> set[str]:
    """Return the names of ours that code uses, as ``sms.NAME``."""
    nodes = [node for node in ast.walk(ast.parse(code)) if isinstance(node, ast.Attribute)]
    return {node.attr for node in nodes if isinstance(node.value, ast.Name) and node.value.id == "sms"}


def test_an_import_loads_nothing_but_itself() -> None:
    """Counted in modules, not in time: a handful of the standard library, and none of ours or of others."""
    code = (
        "import importlib, json, sys, typing; before = set(sys.modules); import sms_handover\n"
        "print(json.dumps(sorted(set(sys.modules) - before)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == [PACKAGE]


def test_every_name_is_there_once() -> None:
    names = offered()
    assert len(set(names)) == len(names) > 50
    assert set(names) < set(dir(sms))
    for name in names:
        assert getattr(sms, name) is getattr(sms, name)
    modules = {path.stem for path in (ROOT / PACKAGE).iterdir()}
    assert not modules & set(names), "a module of that name would take the place of the object"


def test_an_unknown_name_is_an_error_with_the_nearest() -> None:
    code = f"import {PACKAGE} as sms; sms.simulat"
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert done.returncode == 1
    assert "has no attribute 'simulat'. Did you mean: 'simulate'?" in done.stderr
    with pytest.raises(AttributeError):
        _ = sms._no_such  # type: ignore[attr-defined]


@pytest.mark.parametrize("block", CODE, ids=lambda block: block.place)
def test_code_that_a_user_reads_comes_through_the_front_door(block: Block) -> None:
    ours = {name for name in imports(block.text) if name.partition(".")[0] == PACKAGE}
    assert ours <= {PACKAGE}
    assert used(block.text) <= set(offered())


@pytest.mark.parametrize("task", TASKS)
def test_a_task_takes_few_imports(task: str) -> None:
    place, name = TASKS[task]
    found = [block for block in CODE if block.place.partition(":")[0] == place and name in used(block.text)]
    assert found
    for block in found:
        assert len(set(imports(block.text))) <= MOST_MODULES, block.place


def test_a_law_is_a_small_package() -> None:
    """All of it: what pip reads, and the law with its parameters; beside ours it imports NumPy."""
    files = [path for path in SMALL_PACKAGE.rglob("*") if path.suffix in {".py", ".toml", ".cfg", ".xml"}]
    assert {path.name for path in files} == {"pyproject.toml", "my_law.py"}
    assert sum(len(path.read_text("utf-8").splitlines()) for path in files) <= MOST_LINES
    assert set(imports((SMALL_PACKAGE / "my_law.py").read_text("utf-8"))) == {"numpy", PACKAGE}


def test_a_list_of_places_is_the_list_of_imports() -> None:
    """What is read line by line at run time is what a type checker reads."""
    places = sms._places()  # type: ignore[attr-defined]
    assert list(places) == offered()
    assert all(Path(ROOT, *place.split(".")).with_suffix(".py").is_file() for place in places.values())
