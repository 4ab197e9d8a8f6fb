"""The network scope of a graph: this machine, or other hosts too.

The middleware reads it from environment variables when ROS starts in a process.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from socket import AF_INET, gaierror, getaddrinfo

from sms_handover.configuration.package_files import config_file
from sms_handover.errors import ConfigurationError

_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_PEERS = "ROS_STATIC_PEERS"
_LOCALHOST_ONLY = "ROS_LOCALHOST_ONLY"  # deprecated, and stronger than the two above
_PROFILE = "FASTRTPS_DEFAULT_PROFILES_FILE"  # what Fast DDS reads its transports from
_TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"  # of which UDPv4 is honoured; a profile has to name its own
_OPEN_RANGES = ("SUBNET", "SYSTEM_DEFAULT")
_MAX_HOSTS = 32  # of rmw


@dataclass(frozen=True)
class NetworkScope:
    """Who can join the graph: this machine, the ``hosts`` it is announced to, the ``subnet`` by multicast.

    ``profile`` is the user's own for Fast DDS, "" for ours: what it lets through is not known. With
    ``udp_only`` no process uses shared memory.
    """

    hosts: tuple[str, ...] = ()
    subnet: bool = False
    profile: str = ""
    udp_only: bool = False

    @property
    def is_open(self) -> bool:
        """Whether other machines can join."""
        return bool(self.hosts) or self.subnet or bool(self.profile)

    @property
    def environment(self) -> dict[str, str]:
        """The environment variables that set this scope."""
        name = "fastdds_hosts" if self.hosts or self.subnet else "fastdds"
        ours = config_file(f"{name}{'_udp' if self.udp_only else ''}.xml")
        return {
            _RANGE: "SUBNET" if self.subnet else "LOCALHOST",
            _PEERS: ";".join(self.hosts),
            _PROFILE: self.profile or str(ours),
        }

    def __str__(self) -> str:
        if self.hosts or self.subnet:
            to = ["the whole subnet"] * self.subnet + list(self.hosts)
            return (
                f"open to the network, announced to {', '.join(to)}: "
                "whoever reaches this machine can read and command it"
            )
        return f"as far as {self.profile} lets it" if self.profile else "this machine only"


THIS_MACHINE = NetworkScope()


def network_scope_of(environment: Mapping[str, str]) -> NetworkScope:
    """Return the scope that environment variables ask for; by default this machine only."""
    profile = environment.get(_PROFILE, "")
    if Path(profile) in config_file("fastdds.xml").parent.glob("fastdds*.xml"):
        profile = ""  # set by a launcher or another process like this one
    udp_only = environment.get(_TRANSPORTS) == "UDPv4"
    if environment.get(_LOCALHOST_ONLY) == "1":
        return NetworkScope(profile=profile, udp_only=udp_only)
    hosts = tuple(host.strip() for host in environment.get(_PEERS, "").split(";") if host.strip())
    return NetworkScope(hosts, environment.get(_RANGE, "").upper() in _OPEN_RANGES, profile, udp_only)


def network_scope_to(hosts: Sequence[str]) -> NetworkScope:
    """Return the scope of a graph that is announced to these hosts only.

    Raises ConfigurationError if the address of a host is not known, or if the environment forbids it.
    """
    if hosts and os.environ.get(_LOCALHOST_ONLY) == "1":
        raise ConfigurationError(f"{_LOCALHOST_ONLY} is 1, which keeps every other host out; unset it")
    if len(hosts) > _MAX_HOSTS:
        raise ConfigurationError(f"{len(hosts)} hosts are given, must be <= {_MAX_HOSTS}")
    for host in hosts:
        try:
            getaddrinfo(host, None, AF_INET)
        except (gaierror, UnicodeError) as error:
            raise ConfigurationError(
                f"host {host!r} has no IPv4 address here ({error}); give a name that resolves or an address"
            ) from error
    here = network_scope_of(os.environ)
    return NetworkScope(tuple(hosts), profile=here.profile, udp_only=here.udp_only)


def apply_network_scope() -> NetworkScope:
    """Apply the scope that the environment asks for to this process before ROS starts; return it."""
    scope = network_scope_of(os.environ)
    asked = os.environ.get(_RANGE)
    os.environ.update(scope.environment)
    if asked:
        os.environ[_RANGE] = asked  # OFF is as closed as LOCALHOST, but not the same
    return scope
