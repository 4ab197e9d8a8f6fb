"""What the text of a schedule tells without a robot, as for recordings, which carry that text."""

import yaml

from sms_handover.configuration.checks import check_vector
from sms_handover.configuration.yaml_reader import load
from sms_handover.errors import ScheduleError
from sms_handover.types import Array, read_only

_WRONG = (yaml.YAMLError, KeyError, TypeError, ValueError, AttributeError)


def deputy_size(text: str) -> Array:
    """Return the edges (3,) m of the deputy; raises ScheduleError if the text does not say."""
    try:
        return read_only(check_vector(load(text)["deputy"]["size"], 3, "deputy.size", "m", above=0.0))
    except _WRONG as error:
        raise ScheduleError(f"the schedule does not say how large the deputy is: {error}") from error


def deputy_mass(text: str) -> tuple[float, Array]:
    """Return the mass in kg of the deputy and its centre of mass (3,) m in it; raises ScheduleError."""
    try:
        deputy = load(text)["deputy"]
        com = check_vector(deputy.get("com", [0.0, 0.0, 0.0]), 3, "deputy.com", "m")
        return float(deputy["mass"]), read_only(com)
    except _WRONG as error:
        raise ScheduleError(f"the schedule does not say what the deputy weighs: {error}") from error


def grasping_arms(text: str) -> tuple[frozenset[str], ...]:
    """Return, phase by phase, the arms that go to a grasp frame; raises ScheduleError."""
    try:
        return tuple(
            frozenset(
                arm
                for arm, target in (phase.get("arms") or {}).items()
                if isinstance(target, dict) and "grasp_frame" in target
            )
            for phase in load(text)["phases"]
        )
    except _WRONG as error:
        raise ScheduleError(f"the schedule does not say where the arms go: {error}") from error
