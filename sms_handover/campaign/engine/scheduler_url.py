"""URL of a scheduler of others, and whether it is safe to send tasks there."""

import ipaddress
from urllib.parse import urlsplit

from sms_handover.errors import ConfigurationError


def require_safe(url: str, *, trust_network: bool) -> None:
    """Raise ConfigurationError unless a scheduler is here, reached over TLS, or on a network that is trusted.

    Whoever reaches a scheduler over plain TCP can run code on every worker.
    """
    form = f"scheduler {url!r} must be of the form tls://HOST:PORT or tcp://HOST:PORT"
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError as error:
        raise ConfigurationError(f"{form}: {error}") from None
    if parts.scheme not in ("tls", "tcp") or not parts.hostname or not port:
        raise ConfigurationError(form)
    if parts.scheme == "tcp" and not trust_network and not _is_here(parts.hostname):
        raise ConfigurationError(
            f"scheduler {url!r} is plain TCP to another machine, where whoever reaches it can run code: take "
            "tls://, or --trust-network if nobody else is on the network"
        )


def _is_here(host: str) -> bool:
    """Whether a host is this machine by its loopback address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
