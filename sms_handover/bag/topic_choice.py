"""Choice of topics by name and regular expression, as ``ros2 bag`` makes it."""

import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass

from sms_handover.errors import ConfigurationError


@dataclass(frozen=True)
class TopicChoice:
    """Topics named or matched are chosen, all if neither is given, except those excluded.

    A name without a leading slash is one from the root; a regular expression may match any part of
    a name. Raises ConfigurationError on an invalid one.
    """

    topics: tuple[str, ...] = ()
    regex: str = ""
    exclude_topics: tuple[str, ...] = ()
    exclude_regex: str = ""

    def __post_init__(self) -> None:
        for text in (self.regex, self.exclude_regex):
            try:
                re.compile(text)
            except re.error as error:
                raise ConfigurationError(f"regular expression {text!r} is not readable: {error}") from error

    def wants(self, name: str) -> bool:
        """Whether a topic is chosen."""
        full = absolute(name)
        if full in _full(self.exclude_topics) or (self.exclude_regex and re.search(self.exclude_regex, name)):
            return False
        if not self.topics and not self.regex:
            return True
        return full in _full(self.topics) or bool(self.regex and re.search(self.regex, name))

    def absent(self, names: Collection[str]) -> list[str]:
        """Return the topics asked for by name that are not among ``names``."""
        return sorted(_full(self.topics) - _full(names))


def absolute(name: str) -> str:
    """Return a name with a leading slash."""
    return name if name.startswith("/") else f"/{name}"


def _full(names: Iterable[str]) -> set[str]:
    """Return names with a leading slash."""
    return set(map(absolute, names))
