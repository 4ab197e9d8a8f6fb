"""Errors raised on misuse; expected outcomes are values with a status instead."""

from collections.abc import Iterable
from difflib import get_close_matches
from enum import Enum


class SmsHandoverError(Exception):
    """Base of all errors of this package; its text is one line for the user."""


class ConfigurationError(SmsHandoverError, ValueError):
    """A file, parameter or option holds a value that cannot be used."""


class UnknownNameError(ConfigurationError):
    """A name is unknown; the message lists the known ones and the nearest."""

    def __init__(
        self, kind: str, name: str, known: Iterable[str], where: str = "", listed_by: str = ""
    ) -> None:
        """Compose the message, e.g. ``unknown controller 'pdi': known are 'nmpc', 'pid'``.

        ``listed_by`` is the command that lists the known ones where they are too many for a message.
        """
        self.kind = kind
        self.name = name
        self.known = tuple(known)
        nearest = get_close_matches(str(name), self.known, n=1)
        hint = f" (did you mean {nearest[0]!r}?)" if nearest else ""
        listed = ", ".join(repr(item) for item in self.known) or "none"
        listed = f"those of {listed_by!r}" if listed_by else listed
        prefix = f"{where}: " if where else ""
        super().__init__(f"{prefix}unknown {kind} {name!r}{hint}: known are {listed}")


class RobotDescriptionError(ConfigurationError):
    """The robot description is not a physical or not a consistent robot."""


class ScheduleError(ConfigurationError):
    """The task schedule cannot be carried out as written."""


class UnstableLoopError(ConfigurationError):
    """The sampled closed loop of gains and tick diverges at the start configuration."""


class CollisionError(ConfigurationError):
    """Bodies of a scenario collide in a dry run."""


class ControllerError(SmsHandoverError):
    """A controller returned invalid efforts, or cannot go on."""


class NoPlanError(SmsHandoverError):
    """A predictive law finds no plan within its limits again and again; the arms are at rest."""


class BagError(SmsHandoverError):
    """A recording cannot be written, opened or trusted."""


class GraphError(SmsHandoverError):
    """The running graph broke its protocol: a node died, went silent or never appeared."""


class Reason(Enum):
    """Why a message is rejected by the filter of a node; the value is what a user reads."""

    MALFORMED = "malformed"  # truncated, oversized, not of its type
    NOT_FINITE = "not finite"
    NOT_UNIT = "quaternion not of unit length"
    NAMES = "wrong names"
    LENGTHS = "wrong lengths"
    FRAME = "wrong frame"
    DUPLICATE = "duplicate stamp"
    OLD = "stamp out of order"
    FUTURE = "stamp from the future"
    SENDER = "second publisher"


class MessageError(GraphError):
    """A message cannot be used; its subscriber counts it by its reason and continues."""

    def __init__(self, reason: Reason, text: str) -> None:
        self.reason = reason
        super().__init__(text)


class MissingDependencyError(SmsHandoverError, ImportError):
    """A package that only an extra needs is not installed."""

    def __init__(self, what: str, package: str, extra: str) -> None:
        """Compose the message, e.g. ``figures need matplotlib: pip install 'sms_handover[analysis]'``."""
        super().__init__(
            f"{what} need {package}, which is not installed: pip install 'sms_handover[{extra}]'"
        )
