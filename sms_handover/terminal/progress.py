"""How far a long look at a bag is."""

from time import monotonic

from sms_handover.terminal.status_line import StatusLine

_SHORT_S = 1.0  # [s] of wall time; what takes no longer needs no line
_BYTES_PER_MB = 1e6


class ProgressLine:
    """Shows how many bytes have been gone through; use it as a context manager."""

    def __init__(self, what: str) -> None:
        """Say ``what`` is being done."""
        self._what = what
        self._line = StatusLine()
        self._begin = monotonic()

    def __enter__(self) -> "ProgressLine":
        return self

    def __exit__(self, *error: object) -> None:
        self._line.stay()

    def __call__(self, done: int, size: int) -> None:
        """Show ``done`` of ``size`` bytes, if the last update is old enough."""
        if self._line.due and monotonic() - self._begin > _SHORT_S:
            share = 100 * done / max(size, 1)
            megabytes = f"{done / _BYTES_PER_MB:.1f} of {size / _BYTES_PER_MB:.1f} MB"
            self._line.show(f"{self._what}: {megabytes}, {share:.0f} %")
