"""A script in the place of the signal that asks a node to stop."""

from collections.abc import Generator

Script = Generator[None, None, None]


class Stop:
    """Asks to stop when a script has come to its end; each look at it goes one step on."""

    def __init__(self, script: Script | None = None) -> None:
        """Take the script; without one nothing is asked."""
        self._script = script
        self.asked_before = False

    @property
    def asked(self) -> bool:
        """Go one step on, and tell whether to stop."""
        if self._script is not None and not self.asked_before:
            try:
                next(self._script)
            except StopIteration:
                self.asked_before = True
        return self.asked_before
