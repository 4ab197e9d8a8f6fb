"""The law as sms_handover finds it, by the entry point in setup.py: ``--controller task_space_pd``."""

import sms_handover as sms
from my_controller.task_space_pd import TaskSpaceGains, TaskSpacePd


class PhasedTaskSpacePd(TaskSpacePd):
    """The law with the gains of each phase, which a schedule may change."""

    def __init__(self, setup: sms.LawSetup[TaskSpaceGains]) -> None:
        """Set up the law with the gains of the first phase."""
        super().__init__(setup.robot, setup.gains[0])
        self._by_phase = setup.gains

    def guide(self, guidance: sms.Guidance) -> None:
        """Take the gains of the phase, and the targets of the tools."""
        self.use(self._by_phase[guidance.phase.index])
        super().guide(guidance)


LAW = sms.Law(
    "task_space_pd",
    "springs and dampers at the tools, by the transposed generalised Jacobian",
    TaskSpaceGains,
    PhasedTaskSpacePd,
    needs=frozenset({sms.Need.TOOL_TARGETS}),
)
