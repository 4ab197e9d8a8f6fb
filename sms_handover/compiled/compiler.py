"""Compiler: builds shared libraries from C code and caches them."""

import fcntl
import hashlib
import logging
import os
import platform
import shlex
import shutil
import stat
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

from sms_handover.errors import ConfigurationError

_LOG = logging.getLogger(__name__)
# No fused or reordered operations, so that results do not depend on the other flags. Loops over joints are
# vectorised; more passes over the long straight text of the equations take time and gain none.
_VECTORS = ("-ftree-loop-vectorize", "-fvect-cost-model=dynamic")
_FLAGS = ("-O1", *_VECTORS, "-march=native", "-ffp-contract=off", "-fPIC", "-shared")
_TIMEOUT_S = 600.0  # [s] for a compiler that hangs; normally a few seconds
_CPU_KEYS = ("model name", "flags", "CPU part", "Features")  # of /proc/cpuinfo, on x86 and on ARM
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def library_of(what: str, identity: bytes, source: Callable[[], str]) -> Path:
    """Return the shared library of some C code, compiled unless it is cached.

    The key is ``identity``, all that the code depends on, with compiler and processor; ``source`` is called
    only on a miss. The cache is ``sms_handover`` in ``$XDG_CACHE_HOME`` or ``~/.cache``, writable by the user
    alone, as its libraries are executed. Raises ConfigurationError without a C compiler, if it fails, or on a
    folder that others can write to.
    """
    command = _compiler()
    folder = _own_folder()
    parts = (*command, *_FLAGS, _machine(*command))
    key = hashlib.sha256(b"\0".join([identity, *(part.encode() for part in parts)]))
    library = folder / f"{what}-{key.hexdigest()[:32]}.so"
    if not library.exists():
        with _alone(folder):
            if not library.exists():  # nobody else has made it meanwhile
                named = what.replace("_", " ")
                _LOG.warning("compiling the %s of robots of this kind: some seconds, once", named)
                _compile(command, source(), library)
    return library


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Keep other processes from compiling into a folder at the same time.

    A file system without locks only costs work: a library is moved into its place as a whole.
    """
    held = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):
            fcntl.flock(held, fcntl.LOCK_EX)
        yield
    finally:
        os.close(held)


def _compiler() -> list[str]:
    """Return the command of the C compiler: $CC, or cc."""
    command = shlex.split(os.environ.get("CC", "")) or ["cc"]
    if shutil.which(command[0]) is None:
        raise ConfigurationError(
            f"compiled dynamics need a C compiler, and there is no {command[0]!r}: "
            "install one, set CC to it, or take 'pinocchio' instead of 'compiled'"
        )
    return command


@cache
def _machine(*command: str) -> str:
    """Return the versions of platform and compiler, and the processor; they stay while a process runs."""
    try:
        version = _run([*command, "--version"]).stdout
        cpu = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").partition("\n\n")[0]
    except (OSError, subprocess.SubprocessError):
        return platform.platform()
    kept = (line for line in cpu.splitlines() if line.startswith(_CPU_KEYS))
    return "\n".join((platform.platform(), version, *kept))


def _own_folder() -> Path:
    """Return the cache folder, which nobody else can write to."""
    cache = os.environ.get("XDG_CACHE_HOME", "")
    folder = (Path(cache) if os.path.isabs(cache) else Path.home() / ".cache") / "sms_handover"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = folder.stat()
    except OSError as error:
        raise ConfigurationError(f"cannot keep compiled dynamics in {folder}: {error.strerror}") from error
    if found.st_uid != os.getuid() or found.st_mode & _OTHERS_WRITE:
        raise ConfigurationError(
            f"{folder} belongs to user {found.st_uid} and has mode {stat.filemode(found.st_mode)}: "
            "libraries that others can write to are not executed; it must be yours, with mode 0700"
        )
    return folder


def _compile(command: list[str], source: str, library: Path) -> None:
    """Compile a library and move it into place atomically."""
    try:
        with tempfile.TemporaryDirectory(dir=library.parent) as scratch:
            code, made = Path(scratch) / "dynamics.c", Path(scratch) / "dynamics.so"
            code.write_text(source, encoding="ascii")
            call = [*command, *_FLAGS, str(code), "-o", str(made), "-lm"]
            done = _run(call)
            if done.returncode:
                reason = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[0]
                raise ConfigurationError(f"{shlex.join(call)} failed: {reason}")
            made.replace(library)
    except (OSError, subprocess.SubprocessError) as error:
        raise ConfigurationError(f"cannot make {library}: {error}") from error


def _run(command: list[str]) -> "subprocess.CompletedProcess[str]":
    """Run a command and return its output."""
    return subprocess.run(command, check=False, capture_output=True, text=True, timeout=_TIMEOUT_S)
