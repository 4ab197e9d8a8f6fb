"""What of a bag is exported."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from sms_handover.bag.topic_choice import TopicChoice
from sms_handover.errors import ConfigurationError
from sms_handover.run_data import Stamps
from sms_handover.units import NS_PER_S

Mask = npt.NDArray[np.bool_]
Wanted = Callable[[Stamps], Mask]  # which of these stamps are in a range

_LAST_NS = 2**63 - 1  # [ns]


@dataclass(frozen=True)
class Selection:
    """What to export: topics, and from when to when in s after the first message (both included)."""

    topics: TopicChoice = field(default_factory=TopicChoice)
    start: float | None = None
    end: float | None = None

    def __post_init__(self) -> None:
        """Refuse a range that holds nothing."""
        if self.start is not None and self.end is not None and self.start > self.end:
            raise ConfigurationError(f"the range from {self.start:g} s to {self.end:g} s holds nothing")

    @property
    def everything(self) -> bool:
        """Whether no topic is left out."""
        return self.topics == TopicChoice()

    def wanted(self, origin_ns: int) -> Wanted:
        """Return what tells, for stamps of a bag that begins at ``origin_ns``, which are in the range."""
        first_ns, last_ns = self.span(origin_ns)
        return lambda stamps: (stamps >= first_ns) & (stamps <= last_ns)

    def span(self, origin_ns: int) -> tuple[int, int]:
        """Return first and last time in ns of the range."""
        first_ns = 0 if self.start is None else origin_ns + round(self.start * NS_PER_S)
        last_ns = _LAST_NS if self.end is None else origin_ns + round(self.end * NS_PER_S)
        return first_ns, last_ns
