"""Build tf2_msgs with the rosidl wheels, as ``interfaces/setup.py`` builds the package beside it."""

from pathlib import Path

SCRIPT = Path(__file__).resolve().parent.parent / "interfaces" / "setup.py"
exec(compile(SCRIPT.read_text(encoding="utf-8"), __file__, "exec"))
