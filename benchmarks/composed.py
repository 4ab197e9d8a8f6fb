"""The graph composed otherwise than ``--compose`` has it, to measure what that would gain.

Run as a module: the nodes of one process, with commas between, then a command line of ``sms-handover``.
"""

import sys

from sms_handover.cli.main import main as sms_handover
from sms_handover.launcher import launcher


def main() -> int:
    """Run the command with these nodes in one process."""
    together = tuple(sys.argv[1].split(","))
    vars(launcher)["nodes_together"] = lambda mode: together
    return sms_handover(sys.argv[2:])


if __name__ == "__main__":
    sys.exit(main())
