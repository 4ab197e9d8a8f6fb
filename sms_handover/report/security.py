"""A policy that lets a browser run the scripts of a page and nothing else, and load nothing at all."""

from base64 import b64encode
from collections.abc import Iterable
from hashlib import sha256
from html.parser import HTMLParser


def content_security_policy(scripts: Iterable[str]) -> str:
    """Return a Content-Security-Policy under which only these very scripts run and nothing is fetched.

    Whatever a text of a bag might bring into the page, it cannot run: its hash is not among those here.
    A frame made from ``srcdoc`` is held to the same policy.
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
    """Return the text of every script that an HTML document carries."""
    reader = _ScriptReader()
    reader.feed(document)
    reader.close()
    return tuple(reader.scripts)


class _ScriptReader(HTMLParser):
    """Collects the texts of script elements."""

    def __init__(self) -> None:
        """Start outside of any script."""
        super().__init__(convert_charrefs=True)
        self.scripts: list[str] = []
        self._inside = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Begin a script."""
        if tag == "script":
            self._inside = True
            self.scripts.append("")

    def handle_endtag(self, tag: str) -> None:
        """End a script."""
        if tag == "script":
            self._inside = False

    def handle_data(self, data: str) -> None:
        """Add text to the script that is open."""
        if self._inside:
            self.scripts[-1] += data


def _digest(script: str) -> str:
    """Return the SHA-256 of a script as a policy writes it."""
    return b64encode(sha256(script.encode()).digest()).decode("ascii")
