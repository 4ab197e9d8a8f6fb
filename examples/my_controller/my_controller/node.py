"""The law as a node that replaces the controller of sms_handover, by its helper."""

from collections.abc import Sequence

from my_controller.task_space_pd import TaskSpaceGains, TaskSpacePd
from sms_handover.external.controller import run_controller


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_controller("task_space_pd", TaskSpacePd, TaskSpaceGains, args)


if __name__ == "__main__":
    raise SystemExit(main())
