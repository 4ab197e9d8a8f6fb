"""A graph is for this machine alone unless somebody says otherwise; how it is told to the middleware."""

import os
from collections.abc import Mapping
from xml.etree import ElementTree

import pytest

from sms_handover.configuration.package_files import config_file
from sms_handover.errors import ConfigurationError
from sms_handover.ros.process.network_scope import (
    THIS_MACHINE,
    NetworkScope,
    apply_network_scope,
    network_scope_of,
    network_scope_to,
)

RANGE, PEERS = "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS"
LOCALHOST_ONLY, PROFILE = "ROS_LOCALHOST_ONLY", "FASTRTPS_DEFAULT_PROFILES_FILE"
TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"
NAMESPACE = "{http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles}"

ASKED: list[tuple[Mapping[str, str], NetworkScope]] = [
    ({}, THIS_MACHINE),
    ({RANGE: "LOCALHOST"}, THIS_MACHINE),
    ({RANGE: "OFF", PEERS: ""}, THIS_MACHINE),
    ({RANGE: "nonsense"}, THIS_MACHINE),
    ({RANGE: "SUBNET"}, NetworkScope(subnet=True)),
    ({RANGE: "SYSTEM_DEFAULT"}, NetworkScope(subnet=True)),
    ({PEERS: "10.0.0.1; b.local"}, NetworkScope(("10.0.0.1", "b.local"))),
    ({PEERS: "10.0.0.1", RANGE: "SUBNET"}, NetworkScope(("10.0.0.1",), subnet=True)),
    ({PEERS: "10.0.0.1", RANGE: "SUBNET", LOCALHOST_ONLY: "1"}, THIS_MACHINE),
    ({PROFILE: "mine.xml"}, NetworkScope(profile="mine.xml")),
    ({TRANSPORTS: "UDPv4"}, NetworkScope(udp_only=True)),
    ({TRANSPORTS: "UDPv4", PEERS: "b"}, NetworkScope(("b",), udp_only=True)),
]


@pytest.mark.parametrize(("environment", "expected"), ASKED)
def test_the_environment_is_understood_and_what_is_made_of_it_means_the_same(
    environment: Mapping[str, str], expected: NetworkScope
) -> None:
    assert network_scope_of(environment) == expected
    asked = {TRANSPORTS: environment.get(TRANSPORTS, "")}
    assert network_scope_of({**asked, **expected.environment}) == expected


def test_only_what_is_open_says_so() -> None:
    assert str(THIS_MACHINE) == "this machine only"
    assert not THIS_MACHINE.is_open
    for reach, told in (
        (NetworkScope(("b.local",)), "open to the network, announced to b.local"),
        (NetworkScope(subnet=True), "open to the network, announced to the whole subnet"),
        (NetworkScope(profile="mine.xml"), "as far as mine.xml lets it"),
    ):
        assert reach.is_open
        assert told in str(reach)


@pytest.mark.parametrize(("reach", "addresses"), [(THIS_MACHINE, ["127.0.0.1"]), (NetworkScope(("b",)), [])])
def test_the_middleware_listens_where_the_reach_ends(reach: NetworkScope, addresses: list[str]) -> None:
    """LOCALHOST alone does not close a port: only the interfaces in the profile do."""
    profile = ElementTree.parse(reach.environment[PROFILE])
    listed = profile.iterfind(f".//{NAMESPACE}interfaceWhiteList/{NAMESPACE}address")
    assert [item.text for item in listed] == addresses
    builtin = profile.find(f".//{NAMESPACE}useBuiltinTransports")
    assert builtin is not None and builtin.text == "false"


@pytest.mark.parametrize("hosts", [(), ("b",)])
def test_without_shared_memory_nothing_else_is_different(hosts: tuple[str, ...]) -> None:
    """Where it is full a process that maps it is killed."""
    with_it, without = (
        ElementTree.parse(NetworkScope(hosts, udp_only=udp).environment[PROFILE]).getroot()
        for udp in (False, True)
    )
    assert "SHM" not in "".join(without.itertext())
    listed = with_it.find(f".//{NAMESPACE}transport_descriptors")
    used = with_it.find(f".//{NAMESPACE}userTransports")
    assert listed is not None and used is not None
    for descriptor in list(listed):
        if descriptor.findtext(f"{NAMESPACE}type") == "SHM":
            listed.remove(descriptor)
    for item in list(used):
        if item.text == "shared_memory":
            used.remove(item)
    assert [text.split() for text in with_it.itertext() if text.strip()] == [
        text.split() for text in without.itertext() if text.strip()
    ]


def test_a_process_is_set_up_for_this_machine_where_nothing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (RANGE, PEERS, LOCALHOST_ONLY, PROFILE):
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)
    assert apply_network_scope() == THIS_MACHINE
    assert os.environ[RANGE] == "LOCALHOST"
    assert os.environ[PEERS] == ""
    assert os.environ[PROFILE] == str(config_file("fastdds.xml"))


def test_discovery_that_is_off_stays_off(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (PEERS, PROFILE):
        monkeypatch.setenv(name, "")
    monkeypatch.setenv(RANGE, "OFF")
    assert apply_network_scope() == THIS_MACHINE
    assert os.environ[RANGE] == "OFF"


def test_hosts_are_refused_where_they_cannot_be_reached(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ConfigurationError, match=r"'no\.such\.invalid' has no IPv4 address"):
        network_scope_to(["no.such.invalid"])
    with pytest.raises(ConfigurationError, match="33 hosts are given, must be <= 32"):
        network_scope_to(["127.0.0.1"] * 33)
    monkeypatch.setenv(LOCALHOST_ONLY, "1")
    with pytest.raises(ConfigurationError, match="keeps every other host out"):
        network_scope_to(["127.0.0.1"])
    assert not network_scope_to([]).hosts
