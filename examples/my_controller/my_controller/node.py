"""The law as a node that replaces the controller of sms_handover, by its helper."""

from collections.abc import Sequence

import sms_handover as sms
from my_controller.task_space_pd import TaskSpaceGains, TaskSpacePd


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return sms.run_controller("task_space_pd", TaskSpacePd, TaskSpaceGains, args)


if __name__ == "__main__":
    raise SystemExit(main())
