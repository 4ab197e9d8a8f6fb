"""Manifest of a campaign: what it was made with, session by session, and how far it is to go."""

import json
import platform
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from reprlib import repr as shortened
from typing import Any

from sms_handover.bag.provenance import package_version, provenance
from sms_handover.campaign.definition.fields import MOST_CASES
from sms_handover.campaign.record.durable_file import write_durably
from sms_handover.configuration.field_specification import ValueSpec
from sms_handover.errors import ConfigurationError, UnknownNameError

MANIFEST = "manifest.json"
_PACKAGES = ("distributed", "SALib", "scipy", "statsmodels", "pyarrow", "casadi")
_OWN = ("start", "host")  # of a session, in which sessions may differ
_DIGEST = re.compile(r"[0-9a-f]{64}")
_CASES = ValueSpec("number of cases", minimum=1, maximum=MOST_CASES, kind=int)
_TEXT = ValueSpec("text", kind=str)


@dataclass(frozen=True)
class Shard:
    """One of ``of`` parts of a campaign, counted from 1; it has every ``of``-th case."""

    number: int = 1
    of: int = 1

    def has(self, case: int) -> bool:
        """Whether a case is of this part."""
        return case % self.of == self.number - 1

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"


def shard_of(text: str) -> Shard:
    """Return the shard that a text such as ``3/100`` says; raises ConfigurationError."""
    number, slash, of = text.partition("/")
    if not (slash and number.isdecimal() and of.isdecimal() and 1 <= int(number) <= int(of)):
        raise ConfigurationError(f"shard {text!r} must be NUMBER/OF, such as 3/100, counted from 1")
    return Shard(int(number), int(of))


@dataclass(frozen=True)
class Manifest:
    """What a campaign folder is of: digest of the frozen campaign, its cases, its part, and its sessions."""

    digest: str
    name: str
    cases: int | None
    shard: Shard
    sessions: tuple[dict[str, str], ...] = ()

    def with_session(self, session: dict[str, str]) -> "Manifest":
        """Return it with one more session."""
        return replace(self, sessions=(*self.sessions, session))

    @property
    def differences(self) -> tuple[str, ...]:
        """In what of their software and processors the sessions differ, in words."""
        names = {name for session in self.sessions for name in session} - set(_OWN)
        found = []
        for name in sorted(names):
            values = list(dict.fromkeys(session.get(name, "unknown") for session in self.sessions))
            if len(values) > 1:
                found.append(f"{name}: {', then '.join(values)}")
        return tuple(found)


def session() -> dict[str, str]:
    """Return what identifies software, processor and mathematical library of a session."""
    return {
        **provenance(),
        **{f"version.{name}": package_version(name) for name in _PACKAGES},
        "host": platform.node(),
        "processor": _processor(),
        "libm": " ".join(platform.libc_ver()).strip() or "unknown",
    }


def write_manifest(folder: Path, manifest: Manifest) -> None:
    """Write the manifest of a folder whole or not at all, durably; raises SmsHandoverError.

    The journal of the folder must be locked, as what is written was read before.
    """
    write_durably({folder / MANIFEST: f"{json.dumps(asdict(manifest), indent=1)}\n".encode()})


def read_manifest(folder: Path) -> Manifest:
    """Return the manifest of a folder; raises ConfigurationError if it has none or a broken one."""
    path = folder / MANIFEST
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ConfigurationError(f"{folder} is no campaign folder: it has no {MANIFEST}") from None
    except OSError as error:
        raise ConfigurationError(f"{path} cannot be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise ConfigurationError(f"{path} cannot be read: {error}") from error
    try:
        return _manifest_of(values)
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from error


def _manifest_of(values: object) -> Manifest:
    """Return the manifest that JSON values say; raises ConfigurationError."""
    top = _mapping(values, "manifest", [field.name for field in fields(Manifest)])
    shard = _mapping(top["shard"], "shard", [field.name for field in fields(Shard)])
    of = ValueSpec("number of parts", minimum=1, kind=int).check(shard["of"], "shard.of")
    number = ValueSpec("part", minimum=1, maximum=of, kind=int).check(shard["number"], "shard.number")
    if not isinstance(top["digest"], str) or not _DIGEST.fullmatch(top["digest"]):
        raise ConfigurationError(f"digest is {shortened(top['digest'])}, must be 64 hexadecimal digits")
    if not isinstance(top["sessions"], list):
        raise ConfigurationError(f"sessions is {shortened(top['sessions'])}, must be a list")
    return Manifest(
        top["digest"],
        _TEXT.check(top["name"], "name"),
        None if top["cases"] is None else _CASES.check(top["cases"], "cases"),
        Shard(number, of),
        tuple(_session_of(one, f"sessions[{place}]") for place, one in enumerate(top["sessions"])),
    )


def _session_of(value: object, what: str) -> dict[str, str]:
    """Return a session, whatever it has beside its own; raises ConfigurationError."""
    texts = _mapping(value, what, _OWN, others=True)
    return {key: _TEXT.check(text, f"{what}.{key}") for key, text in texts.items()}


def _mapping(value: object, what: str, keys: Sequence[str], *, others: bool = False) -> dict[str, Any]:
    """Return a mapping that has some keys, and no ``others`` unless they are allowed.

    Raises ConfigurationError.
    """
    if not isinstance(value, dict):
        raise ConfigurationError(f"{what} is {shortened(value)}, must be a mapping")
    for key in value:
        if key not in keys and not others:
            raise UnknownNameError("key", key, keys, what)
    for key in keys:
        if key not in value:
            raise ConfigurationError(f"{what} has no key {key!r}, must have {', '.join(keys)}")
    return value


def all_sessions(manifests: Sequence[Manifest]) -> tuple[dict[str, str], ...]:
    """Return the sessions of several folders, each once."""
    return tuple({json.dumps(one): one for manifest in manifests for one in manifest.sessions}.values())


def _processor() -> str:
    """Return the name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.machine())
