"""Library of a kind of robot: the C code of its equations, compiled once for all robots of its structure."""

import hashlib
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from sms_handover.compiled.compiler import library_of
from sms_handover.compiled.tree import Body, Tool, body_tree, hung_of, mounts_of, tools_of
from sms_handover.errors import MissingDependencyError
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.integrators import TABLEAUS, Tableau


def dynamics_library(robot: RobotModel, schemes: Mapping[str, Tableau] = TABLEAUS) -> Path:
    """Return the library with the equations of a robot, made unless it is cached.

    It steps by ``schemes``, by default all that parameters can name. Raises ConfigurationError where it
    cannot be made.
    """
    bodies, tools = body_tree(robot), tools_of(robot)
    identity = _identity(bodies, tools, schemes)
    return library_of("dynamics", identity, lambda: str(_writer().dynamics_source(bodies, tools, schemes)))


def linearisation_library(robot: RobotModel) -> Path:
    """Return the library with the derivatives of a robot's inverse dynamics, made unless it is cached.

    It is apart from the other because it takes longer to compile than all of that. Raises ConfigurationError
    where it cannot be made.
    """
    bodies = body_tree(robot)
    make = "sms_handover.compiled.linearisation_source"
    return library_of("linearisation", _identity(bodies, (), {}), lambda: _written(make, bodies))


def _written(module: str, bodies: tuple[Body, ...]) -> str:
    """Return the C code of the linearisation, by the module that writes it."""
    return str(_writer(module).linearisation_source(bodies))


def _identity(bodies: tuple[Body, ...], tools: tuple[Tool, ...], schemes: Mapping[str, Tableau]) -> bytes:
    """Return a digest of all that the C code depends on: generator, schemes, and how the bodies are joined.

    Their inertial parameters are arguments of the functions, so one library serves every robot that has the
    same joints and tools in the same places; odd mounts are arguments too, and what hangs from them.
    """
    digest = hashlib.sha256(f"{dict(schemes)}".encode() + _generator())
    mounts, hung = mounts_of(bodies), hung_of(bodies)
    digest.update(f"{mounts} {hung}".encode())
    for index, body in enumerate(bodies):
        digest.update(body.parent.to_bytes(4, "little", signed=True))
        place = np.delete(body.place, hung[index]) if index in hung else body.place
        for numbers in (body.axis,) if index in mounts else (body.rotation, place, body.axis):
            digest.update(np.ascontiguousarray(numbers).tobytes())
    for tool in tools:
        digest.update(f"{tool.body} {tool.first_joint} {tool.joints}".encode())
        for numbers in (tool.rotation, tool.place):
            digest.update(np.ascontiguousarray(numbers).tobytes())
    return digest.digest()


@cache
def _generator() -> bytes:
    """Return a digest of what generates the code."""
    digest = hashlib.sha256(f"casadi {_casadi_version()}".encode())
    here = Path(__file__).parent
    for source in (*sorted(here.glob("*.py")), *sorted((here / "native").glob("*.c"))):
        digest.update(source.read_bytes())
    return digest.digest()


def _writer(module: str = "sms_handover.compiled.source") -> Any:
    """Return a C code generator; CasADi is imported only where code must be generated."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if error.name != "casadi":
            raise
        raise MissingDependencyError("compiled dynamics", "casadi", "compiled") from error


def _casadi_version() -> str:
    """Return the version of CasADi, '' without it: cached libraries do not need it."""
    try:
        return version("casadi")
    except PackageNotFoundError:
        return ""
