"""The live line of a terminal: written over in place by rich, never wider than the terminal."""

from contextlib import suppress

from rich.cells import cell_len
from rich.console import Console, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

_GAP = 2  # [columns] between the parts of the line
_BAR = (10, 40)  # [columns] at least and at most; where there is less room there is no bar


class _Console(Console):
    """Standard error with a cursor that is never hidden, as a program that is killed could not restore it."""

    def show_cursor(self, show: bool = True) -> bool:
        return False


class LiveLine:
    """One line, and lines above it that stay."""

    def __init__(self) -> None:
        self._console = _Console(stderr=True, highlight=False)
        self._live: Live | None = None

    @property
    def usable(self) -> bool:
        """Whether the terminal can write over a line; a dumb one cannot."""
        return self._console.is_interactive

    def show(self, text: str, details: str, share: float | None) -> None:
        """Show text, a bar where a share in [0, 1] is given and there is room, and details."""
        with suppress(OSError):
            if self._live is None:
                self._live = Live(
                    console=self._console, auto_refresh=False, redirect_stdout=False, redirect_stderr=False
                )
                self._live.start()
            self._live.update(self._row(text, details, share), refresh=True)

    def print(self, text: str) -> None:
        """Print a text above the line."""
        self._console.print(Text(text), soft_wrap=True)

    def stay(self) -> None:
        """Leave the line as it is; the next one is another."""
        live, self._live = self._live, None
        with suppress(OSError):
            if live is not None:
                live.stop()

    def _row(self, text: str, details: str, share: float | None) -> RenderableType:
        least, most = _BAR
        room = self._console.width - cell_len(text) - cell_len(details) - 2 * _GAP
        if share is None or room < least:
            return Text((text + " " * _GAP + details).rstrip(), no_wrap=True, overflow="ellipsis")
        grid = Table.grid(padding=(0, _GAP, 0, 0))
        grid.add_row(
            Text(text), ProgressBar(total=1.0, completed=share, width=min(room, most)), Text(details)
        )
        return grid
