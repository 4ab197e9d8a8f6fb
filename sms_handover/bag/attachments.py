"""Attachments: the files that make a bag self-contained."""

import json
from collections.abc import Mapping

from sms_handover.errors import BagError

ROBOT_FILE = "robot.urdf"  # names of the attachments
SCHEDULE_FILE = "schedule.yaml"
SCENARIO_FILE = "scenario.yaml"  # robot and schedule as they are and as they are known
PARAMETERS_FILE = "parameters.json"


def parameters_json(parameters: Mapping[str, Mapping[str, object]]) -> str:
    """Return the parameters of all nodes, by node and name, as JSON text."""
    plain = {node: dict(values) for node, values in parameters.items()}
    try:
        return json.dumps(plain, indent=1, sort_keys=True)
    except TypeError as error:
        raise BagError(f"the parameters cannot be stored in the bag: {error}") from error


def parameters_from_json(text: str) -> dict[str, dict[str, object]]:
    """Return the parameters by node and name; raises BagError if the text is not such JSON."""
    try:
        values = json.loads(text)
    except ValueError as error:
        raise BagError(f"{PARAMETERS_FILE} in the bag is not JSON: {error}") from error
    if not isinstance(values, dict) or not all(isinstance(value, dict) for value in values.values()):
        raise BagError(f"{PARAMETERS_FILE} in the bag does not hold parameters by node and name")
    return values
