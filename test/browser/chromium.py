"""Where Chromium is, how it is started without a screen, and the sizes that pages are tested at."""

import os
import shutil

WIDE, NARROW = (1280, 800), (390, 760)  # [px] of a desk and of a telephone
NEEDED = "SMS_HANDOVER_NEEDS_BROWSER"  # set where a missing Chromium is a failure, not a reason to skip
ARGUMENTS = (
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-angle=swiftshader",  # WebGL on the processor
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
)

_NAMES = ("chromium", "chromium-browser", "google-chrome")


def find_chromium() -> str | None:
    """Return the path of a Chromium, None if this machine has none."""
    return next((path for path in map(shutil.which, _NAMES) if path), None)


def absence() -> str:
    """Return what to say where there is no Chromium."""
    return f"no Chromium on this machine: looked for {', '.join(_NAMES)}"


def is_needed() -> bool:
    """Whether a missing Chromium is a failure."""
    return bool(os.environ.get(NEEDED))
