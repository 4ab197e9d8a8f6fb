"""The law as sms_handover finds it, by the entry point in setup.py: ``--controller task_space_pd``."""

from my_controller.task_space_pd import TaskSpaceGains, TaskSpacePd
from sms_handover.control.law import Law, LawSetup, Need
from sms_handover.control.protocol import Guidance


class PhasedTaskSpacePd(TaskSpacePd):
    """The law with the gains of each phase, which a schedule may change."""

    def __init__(self, setup: LawSetup[TaskSpaceGains]) -> None:
        """Set up the law with the gains of the first phase."""
        super().__init__(setup.robot, setup.gains[0])
        self._by_phase = setup.gains

    def guide(self, guidance: Guidance) -> None:
        """Take the gains of the phase, and the targets of the tools."""
        self.use(self._by_phase[guidance.phase.index])
        super().guide(guidance)


LAW = Law(
    "task_space_pd",
    "springs and dampers at the tools, by the transposed generalised Jacobian",
    TaskSpaceGains,
    PhasedTaskSpacePd,
    needs=frozenset({Need.TOOL_TARGETS}),
)
