"""Pinocchio's model of a floating robot from URDF text alone, as a recording carries it."""

import pinocchio as pin

from sms_handover.errors import RobotDescriptionError, UnknownNameError


def floating_model(urdf: str) -> pin.Model:
    """Return the model with a free-flyer root; raises RobotDescriptionError if the text is no robot."""
    try:
        return pin.buildModelFromXML(urdf, pin.JointModelFreeFlyer())
    except (ValueError, RuntimeError) as error:
        raise RobotDescriptionError(f"the robot description cannot be read: {error}") from error


def joint_columns(model: pin.Model, joint_names: tuple[str, ...]) -> list[int]:
    """Return where the angle of each joint lies in a configuration (7 + n,); raises UnknownNameError."""
    known = tuple(model.names[2:])  # after Pinocchio's universe and the floating joint
    for name in joint_names:
        if name not in known:
            raise UnknownNameError("joint", name, known, "robot description")
    return [int(model.joints[model.getJointId(name)].idx_q) for name in joint_names]
