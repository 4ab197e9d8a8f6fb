"""What a colcon workspace must hold after the build, read from the sources; run by ``.ci/colcon``.

``python test/workspace.py INSTALL`` looks into the install folder of a workspace and names every
executable, index resource or shared file that is missing. It needs the standard library alone.
"""

import ast
import os
import sys
from collections.abc import Iterator
from pathlib import Path

PACKAGE = "sms_handover"
INTERFACES = "sms_handover_interfaces"
ROOT = Path(__file__).resolve().parent.parent


def entry_points(*lists: str) -> list[str]:
    """Return every ``name = module:function`` in these lists of setup.py, as a workspace installs them."""
    tree = ast.parse((ROOT / "setup.py").read_text(encoding="utf-8"))
    assignments = [node for node in tree.body if isinstance(node, ast.Assign)]
    found = [a for a in assignments if isinstance(a.targets[0], ast.Name) and a.targets[0].id in lists]
    return [entry for assignment in found for entry in ast.literal_eval(assignment.value)]


def executables() -> list[str]:
    """Return the names that ``ros2 run sms_handover`` must know."""
    return [entry.split(" = ")[0] for entry in entry_points("USER_COMMANDS", "ROS_EXECUTABLES")]


def expected() -> Iterator[str]:
    """Yield every file that must be there, relative to the install folder."""
    for name in executables():
        yield f"{PACKAGE}/lib/{PACKAGE}/{name}"
    index = "share/ament_index/resource_index"
    yield f"{PACKAGE}/{index}/packages/{PACKAGE}"
    yield f"{INTERFACES}/{index}/packages/{INTERFACES}"
    yield f"{INTERFACES}/{index}/rosidl_interfaces/{INTERFACES}"
    for name, folder in ((PACKAGE, ROOT), (INTERFACES, ROOT / "interfaces")):
        patterns = ("package.xml", "config/**/*", "launch/*.py", "msg/*.msg", "srv/*.srv")
        for path in sorted(path for pattern in patterns for path in folder.glob(pattern) if path.is_file()):
            yield f"{name}/share/{name}/{path.relative_to(folder)}"


def missing(install: Path) -> list[str]:
    """Name what a workspace lacks, and executables that cannot be executed."""
    found = []
    for name in expected():
        path = install / name
        if not path.is_file():
            found.append(f"{name} is missing")
        elif f"/lib/{PACKAGE}/" in name and not os.access(path, os.X_OK):
            found.append(f"{name} is not executable")
    return found


def main() -> int:
    """Print what is missing; return 1 if anything is."""
    found = missing(Path(sys.argv[1]))
    for line in found:
        print(f"workspace: {line}", file=sys.stderr)
    if not found:
        print(f"workspace: all {len(list(expected()))} files are installed")
    return 1 if found else 0


if __name__ == "__main__":
    raise SystemExit(main())
