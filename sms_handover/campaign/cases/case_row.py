"""Row of a case: what it was given, how it ended, its metrics; and beside it what depends on the machine."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import Enum
from typing import Any, NamedTuple

from sms_handover.campaign.definition.distributions import Value
from sms_handover.errors import ConfigurationError


class Task(NamedTuple):
    """One run of a campaign: the number of its case, its scenario and its law by name."""

    case: int
    scenario: str
    law: str

    def __str__(self) -> str:
        return f"case {self.case} of {self.scenario} under {self.law}"


class Status(Enum):
    """How a case ended; the value is what a user reads."""

    SUCCEEDED = "succeeded"
    MISSION_FAILED = "mission failed"  # it ran to its end without success, or its law found no plan
    NUMERIC_FAILURE = "numeric failure"  # numbers that are not finite, or a law that broke down
    REJECTED = "rejected"  # no scenario can have the drawn values
    ERROR = "error"  # an exception that nobody expected
    LIMIT = "limit"  # ticks, wall time or memory
    DIED = "died"  # its process ended


@dataclass(frozen=True)
class Row:
    """One run of a campaign, a pure function of campaign, case, scenario and law.

    ``inputs`` are as read back from plant and model, ``metrics`` in SI units, None where one is not defined;
    none of them where a law found no plan; ``run_digest`` is that of all data, '' where there is no run.
    """

    task: Task
    seed: int
    inputs: Mapping[str, Value]
    status: Status
    cause: str
    metrics: Mapping[str, float | None]
    run_digest: str

    @property
    def succeeded(self) -> bool:
        """Whether the case is a success."""
        return self.status is Status.SUCCEEDED

    @property
    def mission_failure(self) -> bool:
        """Whether the run came to its end without success, or to rest without a plan."""
        return self.status is Status.MISSION_FAILED

    @property
    def numeric_failure(self) -> bool:
        """Whether there is no run to judge: not finite, rejected, broken, over a limit, dead."""
        return not (self.succeeded or self.mission_failure)

    @property
    def digest(self) -> str:
        """SHA-256 of the row, as hexadecimal digits."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def text(self) -> str:
        """The row as JSON, the same for the same row."""
        values = {**asdict(self), "task": list(self.task), "status": self.status.value}
        return json.dumps(values, sort_keys=True, allow_nan=False, separators=(",", ":"))


@dataclass(frozen=True)
class Beside:
    """What was measured beside a row: CPU seconds, wall time s, host, and how often it was tried.

    ``solve`` is the median wall time in s of a solve of a law that plans, None of any other.
    """

    cpu: float
    wall: float
    host: str
    tries: int = 1
    solve: float | None = None


def row_of(values: Any) -> Row:
    """Return the row that JSON values say; raises ConfigurationError if they are none."""
    try:
        case, scenario, law = values["task"]
        return Row(
            Task(int(case), str(scenario), str(law)),
            int(values["seed"]),
            dict(values["inputs"]),
            Status(values["status"]),
            str(values["cause"]),
            dict(values["metrics"]),
            str(values["run_digest"]),
        )
    except (KeyError, ValueError, TypeError) as error:
        raise ConfigurationError(f"no row of a campaign: {error}") from error
