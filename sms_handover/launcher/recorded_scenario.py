"""The scenario of a recorded run, out of its bag."""

from pathlib import Path

from sms_handover.bag.info import BagInfo
from sms_handover.configuration.scenario_file import COMMON
from sms_handover.configuration.values import roles_of
from sms_handover.errors import BagError
from sms_handover.graph.topics import CONTROLLER, IK, PLANT, TRAJECTORY
from sms_handover.simulation.parameters import CommonParameters
from sms_handover.simulation.scenario import Scenario, load_scenario

_NODES = (PLANT, TRAJECTORY, IK, CONTROLLER)
_COMMON_NAMES = frozenset(CommonParameters.__dataclass_fields__)
_ROS_OWN = {"use_sim_time", "start_type_description_service"}
_FIRST_EDITION = "colliding"  # whose robot recordings without a scenario were made with


def scenario_in(info: BagInfo, folder: Path) -> Scenario:
    """Return the scenario that a bag was made with; its files are unpacked into ``folder``.

    Raises BagError if the bag does not say, or if the robot description has changed since.
    """
    if not info.parameters.keys() >= {*_NODES} or info.schedule_text is None or info.urdf_text is None:
        raise BagError(f"{info.path} does not say what it was made with")
    overrides: dict[str, dict[str, object]] = {}
    for node in _NODES:
        values = info.parameters[node]
        overrides[node] = {n: v for n, v in values.items() if n not in _COMMON_NAMES | _ROS_OWN}
        overrides[COMMON] = {n: v for n, v in values.items() if n in _COMMON_NAMES}
    if info.scenario_text is not None:
        overrides[COMMON] |= _written_out(info.scenario_text, folder, overrides[COMMON].get("values", ()))
    else:
        schedule = folder / "schedule.yaml"
        schedule.write_text(info.schedule_text, encoding="utf-8")
        overrides[COMMON] |= {"scenario": _FIRST_EDITION, "schedule": str(schedule)}
    scenario = load_scenario(values=overrides)
    if scenario.truth.robot.urdf != info.urdf_text:
        raise BagError(f"{info.path} was made with another robot description than the one in use now")
    return scenario


def _written_out(text: str, folder: Path, values: object) -> dict[str, object]:
    """Return parameters that name a scenario which has everything but what is for one role alone."""
    file = folder / "scenario.yaml"
    file.write_text(text, encoding="utf-8")
    of_roles = [value for value in values if any(roles_of([value]))] if isinstance(values, list) else []
    return {"scenario": str(file), "robot": "", "schedule": "", "conditions": "", "values": of_roles}
