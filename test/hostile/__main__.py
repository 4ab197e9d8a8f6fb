"""Runs the hostile attempts as ``python test/hostile``."""

import sys
from pathlib import Path

import test  # Python's own package of this name; our folder of tests becomes a part of it

_HERE = Path(__file__).resolve().parent
_OWN = (str(_HERE), "test/hostile")
sys.path[:] = [str(_HERE.parents[1]), *(path for path in sys.path if path not in _OWN)]
test.__path__.insert(0, str(_HERE.parent))

from test.hostile.command import main  # noqa: E402  (found only now)

if __name__ == "__main__":
    raise SystemExit(main())
