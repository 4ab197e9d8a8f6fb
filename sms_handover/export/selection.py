"""Selection of topics and times of a bag to export."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from sms_handover.bag.topic_choice import TopicChoice
from sms_handover.errors import ConfigurationError
from sms_handover.run_data import Stamps
from sms_handover.units import NS_PER_S

Mask = npt.NDArray[np.bool_]
Wanted = Callable[[Stamps], Mask]  # the stamps within a time range

_LAST_NS = 2**64 - 1  # [ns]


@dataclass(frozen=True)
class Selection:
    """Topics, and times in s after the first message (both ends included)."""

    topics: TopicChoice = field(default_factory=TopicChoice)
    start: float | None = None
    end: float | None = None

    def __post_init__(self) -> None:
        """Reject an empty range."""
        if self.start is not None and self.end is not None and self.start > self.end:
            raise ConfigurationError(f"the range from {self.start:g} s to {self.end:g} s is empty")

    @property
    def everything(self) -> bool:
        """Whether all topics are selected."""
        return self.topics == TopicChoice()

    def wanted(self, origin_ns: int) -> Wanted:
        """Return the mask of stamps in the range, for a bag that begins at ``origin_ns``."""
        first_ns, last_ns = self.span(origin_ns)
        return lambda stamps: (stamps >= first_ns) & (stamps <= last_ns)

    def span(self, origin_ns: int) -> tuple[int, int]:
        """Return the first and last time of the range, in ns."""
        first_ns = 0 if self.start is None else origin_ns + round(self.start * NS_PER_S)
        last_ns = _LAST_NS if self.end is None else origin_ns + round(self.end * NS_PER_S)
        return first_ns, last_ns
