"""Recording progress: how far the recorder has come, and whether the plant has to wait for it."""

from sms_handover.errors import MessageError, Reason
from sms_handover.graph.topics import RECORDER
from sms_handover.simulation.parameters import CommonParameters

_MOST_UNRECORDED_NS = 45_000_000  # [ns] of simulation time that may be lost with the recorder


class RecordingProgress:
    """Keeps the plant from getting further ahead of the recorder than may be lost if that were killed.

    A run without a recorder never waits.
    """

    def __init__(self, common: CommonParameters) -> None:
        """Begin a run; ``is_recorded`` tells whether it has a recorder."""
        self.is_recorded, self._tick_ns = RECORDER in common.peers, common.tick_ns
        self.reset()

    def reset(self) -> None:
        """Begin a new run."""
        self._recorded_ns = 0

    def holds(self, stamp_ns: int) -> bool:
        """Whether the state after that of ``stamp_ns`` would be further ahead than may be lost."""
        return self.is_recorded and stamp_ns + self._tick_ns - self._recorded_ns > _MOST_UNRECORDED_NS

    def recorded(self, until_ns: int, stamp_ns: int) -> None:
        """Note that all is recorded until a time, in a run that has come to ``stamp_ns``.

        Raises MessageError if the recorder said so before, or the time lies ahead.
        """
        if not self._recorded_ns <= until_ns <= stamp_ns:
            reason = Reason.OLD if until_ns < self._recorded_ns else Reason.FUTURE
            allowed = f"must be {self._recorded_ns} to {stamp_ns} ns"
            raise MessageError(reason, f"recorded up to {until_ns} ns, {allowed}")
        self._recorded_ns = until_ns
