"""How far the graph of a process reaches: this machine, or other hosts too.

The middleware is told by environment variables, before ROS is started in a process.
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
_TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"  # of which UDPv4 is followed; a profile has to name its own
_OPEN_RANGES = ("SUBNET", "SYSTEM_DEFAULT")
_MOST_HOSTS = 32  # that rmw takes


@dataclass(frozen=True)
class NetworkScope:
    """Who can be in the graph: this machine, the ``hosts`` that are told of it, the ``subnet`` by multicast.

    ``profile`` is the user's own for Fast DDS, "" for ours: what it lets through is not known. With
    ``udp_only`` no process uses shared memory.
    """

    hosts: tuple[str, ...] = ()
    subnet: bool = False
    profile: str = ""
    udp_only: bool = False

    @property
    def is_open(self) -> bool:
        """Whether others than this machine can take part."""
        return bool(self.hosts) or self.subnet or bool(self.profile)

    @property
    def environment(self) -> dict[str, str]:
        """Return the environment variables that make it so."""
        name = "fastdds_hosts" if self.hosts or self.subnet else "fastdds"
        ours = config_file(f"{name}{'_udp' if self.udp_only else ''}.xml")
        return {
            _RANGE: "SUBNET" if self.subnet else "LOCALHOST",
            _PEERS: ";".join(self.hosts),
            _PROFILE: self.profile or str(ours),
        }

    def __str__(self) -> str:
        """Return in words who can read and command the graph."""
        if self.hosts or self.subnet:
            to = ["the whole subnet"] * self.subnet + list(self.hosts)
            return (
                f"open to the network, announced to {', '.join(to)}: "
                "whoever reaches this machine can read and command it"
            )
        return f"as far as {self.profile} lets it" if self.profile else "this machine only"


THIS_MACHINE = NetworkScope()


def network_scope_of(environment: Mapping[str, str]) -> NetworkScope:
    """Return the reach that environment variables ask for; where they say nothing, this machine only."""
    profile = environment.get(_PROFILE, "")
    if Path(profile) in config_file("fastdds.xml").parent.glob("fastdds*.xml"):
        profile = ""  # a launcher has chosen it, or another process like this one
    udp_only = environment.get(_TRANSPORTS) == "UDPv4"
    if environment.get(_LOCALHOST_ONLY) == "1":
        return NetworkScope(profile=profile, udp_only=udp_only)
    hosts = tuple(host.strip() for host in environment.get(_PEERS, "").split(";") if host.strip())
    return NetworkScope(hosts, environment.get(_RANGE, "").upper() in _OPEN_RANGES, profile, udp_only)


def network_scope_to(hosts: Sequence[str]) -> NetworkScope:
    """Return the reach of a graph that is announced to these hosts and to nobody else.

    Raises ConfigurationError on a host whose address is not known, and where the environment forbids it.
    """
    if hosts and os.environ.get(_LOCALHOST_ONLY) == "1":
        raise ConfigurationError(f"{_LOCALHOST_ONLY} is 1, which keeps every other host out; unset it")
    if len(hosts) > _MOST_HOSTS:
        raise ConfigurationError(f"{len(hosts)} hosts are given, allowed are {_MOST_HOSTS}")
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
    """Set up this process for what its environment asks for, and return that; before ROS is started."""
    reach = network_scope_of(os.environ)
    asked = os.environ.get(_RANGE)
    os.environ.update(reach.environment)
    if asked:
        os.environ[_RANGE] = asked  # OFF is as closed as LOCALHOST, but not the same
    return reach
