"""QoS profiles that the publishers of a recorded topic offered, as stored in a bag."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Any, TypeVar

from sms_handover.bag.qos import Durability, History, Reliability, profiles_of
from sms_handover.configuration.checks import check_number
from sms_handover.configuration.yaml_reader import read_yaml
from sms_handover.errors import ConfigurationError, UnknownNameError
from sms_handover.units import NS_PER_S

E = TypeVar("E", bound=Enum)


class Liveliness(Enum):
    """Liveliness policies."""

    AUTOMATIC = "automatic"
    MANUAL_BY_TOPIC = "manual_by_topic"


@dataclass(frozen=True)
class Offer:
    """An offered QoS profile; durations are in ns, None is infinite."""

    reliability: Reliability = Reliability.RELIABLE
    durability: Durability = Durability.VOLATILE
    history: History = History.UNKNOWN
    depth: int = 0
    deadline_ns: int | None = None
    lifespan_ns: int | None = None
    liveliness: Liveliness = Liveliness.AUTOMATIC
    lease_ns: int | None = None

    @property
    def latched(self) -> bool:
        """Whether late subscribers still get the latest messages."""
        return self.durability is Durability.TRANSIENT_LOCAL


_POLICIES: dict[str, type[Enum]] = {
    "history": History,
    "reliability": Reliability,
    "durability": Durability,
    "liveliness": Liveliness,
}
_DURATIONS = {"deadline": "deadline_ns", "lifespan": "lifespan_ns", "liveliness_lease_duration": "lease_ns"}
_IGNORED = ("avoid_ros_namespace_conventions",)
_INFINITE_FROM_S = 2**31 - 1  # [s] infinity as written by ROS 2 Foxy; later versions write more


def read_offer(text: str) -> Offer:
    """Return the profile to play a topic with, from the ``offered_qos_profiles`` of its channel.

    If publishers differed, the strongest reliability and durability are taken, which are compatible with
    every subscriber. An unreadable text counts as none.
    """
    offers = [with_policies(Offer(), profile, "offered_qos_profiles") for profile in profiles_of(text)]
    if not offers:
        return Offer()
    first = offers[0]
    return replace(
        first if all(offer == first for offer in offers) else Offer(),
        reliability=_strongest(Reliability.RELIABLE, [offer.reliability for offer in offers]),
        durability=_strongest(Durability.TRANSIENT_LOCAL, [offer.durability for offer in offers]),
        history=first.history,
        depth=max(offer.depth for offer in offers),
    )


def read_overrides(path: Path) -> Mapping[str, Mapping[str, Any]]:
    """Return the policy overrides by topic from a file in the form of ``ros2 bag play``, checked."""
    overrides = read_yaml(path)
    for topic, policies in overrides.items():
        if not isinstance(policies, dict):
            raise ConfigurationError(f"{path}: the policies of {topic} are not a mapping")
        with_policies(Offer(), policies, f"{path}: {topic}")
    return overrides


def with_policies(offer: Offer, policies: Mapping[str, Any], where: str) -> Offer:
    """Return a profile with some policies changed; raises ConfigurationError on unknown ones."""
    changes: dict[str, Any] = {}
    for name, value in policies.items():
        if name in _POLICIES:
            policy = _policy(_POLICIES[name], value, f"{where}: {name}")
            if policy is not None:
                changes[name] = policy
        elif name in _DURATIONS:
            changes[_DURATIONS[name]] = _duration_ns(value, f"{where}: {name}")
        elif name == "depth":
            changes[name] = _count(value, f"{where}: depth")
        elif name not in _IGNORED:
            raise UnknownNameError("policy", str(name), (*_POLICIES, *_DURATIONS, "depth"), where)
    return replace(offer, **changes)


def _policy(kind: type[E], value: object, where: str) -> E | None:
    """Return the value of a policy, None if it was left to the middleware or is not known."""
    if value in ("system_default", "unknown", "best_available"):
        return None
    try:
        return kind(value)
    except ValueError:
        known = [str(item.value) for item in kind]
        raise UnknownNameError("value", str(value), known, where) from None


def _duration_ns(value: object, where: str) -> int | None:
    """Return a duration of ``sec`` and ``nsec`` in ns, None if infinite or unset."""
    if not isinstance(value, dict) or not {"sec", "nsec"} <= value.keys():
        raise ConfigurationError(f"{where} is {value!r}, must be a mapping with sec and nsec")
    seconds, nanoseconds = (_count(value[key], f"{where}.{key}") for key in ("sec", "nsec"))
    if seconds >= _INFINITE_FROM_S or (seconds, nanoseconds) == (0, 0):
        return None
    return seconds * NS_PER_S + nanoseconds


def _count(value: object, where: str) -> int:
    """Return a whole number that is not negative."""
    return int(check_number(value, where, minimum=0, whole=True))


def _strongest(strong: E, found: list[E]) -> E:
    """Return ``strong`` if it was found, else the policy that all share."""
    return strong if strong in found else found[0]
