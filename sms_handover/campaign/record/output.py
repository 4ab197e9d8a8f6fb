"""Output of a campaign: one thing that was made of its rows, or could not be, in a line."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Output:
    """A line on something that was made; ``is_lacking`` if it was asked for and could not be made."""

    text: str
    is_lacking: bool = False
