"""What is read is never run, names in it lead out of no folder, and files are the user's own."""

import ast
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import yaml

from sms_handover.bag.recording import Recording
from sms_handover.configuration.parameters import read_parameter_files
from sms_handover.configuration.yaml_reader import YamlLoader
from sms_handover.errors import SmsHandoverError
from sms_handover.export.csv_files import CsvFormat
from sms_handover.export.output import Tables
from sms_handover.model.description import load_robot
from sms_handover.simulation.scenario import load_scenario

ROOT = Path(__file__).resolve().parents[2]
FILES = [
    path for part in ("sms_handover", "launch", "benchmarks") for path in sorted((ROOT / part).rglob("*.py"))
]

FORBIDDEN_MODULES = {"pickle", "cPickle", "marshal", "shelve", "dill", "cloudpickle", "joblib", "code", "imp"}
# Both ends of a socket pair that nobody else can open: a solver reads what the process that made it has sent.
OWN_SOCKETS = {f"sms_handover/simulation/{name}.py": ["pickle"] for name in ("solver_main", "solver_process")}
FORBIDDEN_CALLS = {
    "eval", "exec", "compile", "__import__", "os.system", "os.popen", "os.umask", "tempfile.mktemp",
    "yaml.unsafe_load", "yaml.full_load", "yaml.load_all", "yaml.unsafe_load_all", "yaml.full_load_all",
}  # fmt: skip
SAFE_LOADERS = {"YamlLoader", "yaml.SafeLoader", "yaml.CSafeLoader"}


def dotted(node: ast.expr) -> str:
    """Return ``a.b.c`` for such an expression, else ''."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute) and (before := dotted(node.value)):
        return f"{before}.{node.attr}"
    return ""


def dangers(tree: ast.AST) -> Iterator[str]:
    """Yield in words what in a syntax tree runs, or could run, what it has read."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (item.name for item in node.names if item.name.split(".")[0] in FORBIDDEN_MODULES)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in FORBIDDEN_MODULES:
            yield str(node.module)
        elif isinstance(node, ast.Call):
            yield from dangers_of_call(node)


def dangers_of_call(call: ast.Call) -> Iterator[str]:
    """Yield in words what is wrong with a call."""
    name = dotted(call.func)
    named = {keyword.arg: keyword.value for keyword in call.keywords}
    if name in FORBIDDEN_CALLS or name.endswith(".chmod"):
        yield name
    shell = named.get("shell")
    if shell is not None and not (isinstance(shell, ast.Constant) and shell.value is False):
        yield f"{name} by a shell"
    if name == "yaml.load":
        loader = named.get("Loader") or (call.args[1] if len(call.args) > 1 else ast.Constant(None))
        if dotted(loader) not in SAFE_LOADERS:
            yield "yaml.load with another loader"
    if name in ("np.load", "numpy.load"):
        allowed = named.get("allow_pickle")
        if not (isinstance(allowed, ast.Constant) and allowed.value is False):
            yield f"{name} that may unpickle"
    if name.endswith("jinja2.Environment"):
        escapes = named.get("autoescape")
        if not (isinstance(escapes, ast.Constant) and escapes.value is True):
            yield "a template that does not escape"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_nothing_that_is_read_is_run(path: Path) -> None:
    found = list(dangers(ast.parse(path.read_text(encoding="utf-8"))))
    assert found == OWN_SOCKETS.get(path.relative_to(ROOT).as_posix(), [])


@pytest.mark.parametrize(
    "code",
    [
        "import pickle",
        "from joblib import load",
        "eval(text)",
        "os.system(command)",
        "subprocess.run(command, shell=True)",
        "yaml.load(text, yaml.Loader)",
        "yaml.load(text)",
        "np.load(file)",
        "np.load(file, allow_pickle=True)",
        "jinja2.Environment(loader=loader)",
        "jinja2.Environment(autoescape=False)",
        "path.chmod(0o777)",
    ],
)
def test_the_look_at_the_code_sees(code: str) -> None:
    assert list(dangers(ast.parse(code)))


def test_the_loader_of_yaml_is_a_safe_one() -> None:
    assert issubclass(YamlLoader, yaml.SafeLoader)


READERS: dict[str, Callable[[Path], object]] = {
    "schedule": lambda path: load_scenario("colliding", {"common": {"schedule": str(path)}}),
    "robot": load_robot,
    "parameters": lambda path: read_parameter_files([path], "plant"),
}


@pytest.mark.parametrize("reader", list(READERS))
@pytest.mark.parametrize("tag", ["python/object/apply:os.mkdir", "python/object/new:os.mkdir"])
def test_a_yaml_file_makes_no_object_and_calls_nothing(reader: str, tag: str, tmp_path: Path) -> None:
    made = tmp_path / "made"
    file = tmp_path / "file.yaml"
    file.write_text(f"name: !!{tag} [{made}]\n", encoding="utf-8")
    with pytest.raises(SmsHandoverError):
        READERS[reader](file)
    assert not made.exists()


@pytest.mark.parametrize(
    "topic", ["/../../escaped", "..", "/", "/a/../../b", "/etc/passwd", "a\0b", "a\\..\\b"]
)
def test_no_name_in_a_bag_leads_out_of_the_folder(topic: str, tmp_path: Path) -> None:
    folder = tmp_path / "tables"
    folder.mkdir()
    tables = Tables(folder, CsvFormat(folder))
    _, table = tables.open(topic, [], topic)
    table.close()
    (made,) = (path for path in tmp_path.rglob("*") if path != folder)
    assert made.parent == folder and made.is_file()


@pytest.mark.parametrize(("umask", "mode"), [(0o022, 0o644), (0o077, 0o600), (0o027, 0o640)])
def test_a_recording_has_the_permissions_that_the_user_lets_files_have(
    umask: int, mode: int, tmp_path: Path
) -> None:
    before = os.umask(umask)
    try:
        recording = Recording(tmp_path / "bag")
        recording.begin()
        recording.close()
    finally:
        os.umask(before)
    files = [path for path in (tmp_path / "bag").rglob("*") if path.is_file()]
    assert files
    assert {path.stat().st_mode & 0o777 for path in files} == {mode}
