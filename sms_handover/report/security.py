"""Content-Security-Policy of the report: its own scripts run, nothing else does, and nothing is loaded."""

import re
from base64 import b64encode
from collections.abc import Iterable
from hashlib import sha256

_SCRIPT = re.compile(r"<script\b[^>]*>(.*?)</script\s*>", re.DOTALL | re.IGNORECASE)


def content_security_policy(scripts: Iterable[str]) -> str:
    """Return a Content-Security-Policy that allows these scripts by their hashes and no requests at all.

    A script that came with a text from a bag does not run, because its hash is not listed. A frame made
    from ``srcdoc`` inherits the policy.
    """
    hashes = " ".join(f"'sha256-{_digest(script)}'" for script in scripts)
    return "; ".join(
        (
            "default-src 'none'",
            f"script-src {hashes}",
            "style-src 'unsafe-inline'",  # plotly places its elements by style attributes
            "img-src data: blob:",  # a plot saved as an image
            "base-uri 'none'",
            "form-action 'none'",
        )
    )


def inline_scripts(document: str) -> tuple[str, ...]:
    """Return the text of every script element of an HTML document.

    A browser ends a script at the first closing tag whatever surrounds it, so no parser is needed.
    """
    return tuple(_SCRIPT.findall(document))


def _digest(script: str) -> str:
    """Return the SHA-256 of a script, in base64 as a policy lists it."""
    return b64encode(sha256(script.encode()).digest()).decode("ascii")
