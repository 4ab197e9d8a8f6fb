"""Links of a robot described by URDF text: their poses, frame by frame."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from sms_handover.frames import tool_frame
from sms_handover.model.floating_model import floating_model, joint_columns
from sms_handover.model.poses import pose_of, pose_row
from sms_handover.model.robot_model import BASE_NQ
from sms_handover.run_data import RunData
from sms_handover.types import Array

Rows = npt.NDArray[np.int64]


def moving_joints(run: RunData, ticks: Rows, periods: Rows) -> tuple[Array, tuple[str, ...]]:
    """Return the positions (T, n + p) rad of arms and panels at some ticks and periods, and their names."""
    angles = np.hstack([run.joint_position[ticks], run.panel_position[periods]])
    return angles, (*run.joint_names, *run.panel_names)


class DescribedRobot:
    """A free-floating robot built from URDF text alone, as a bag contains it."""

    def __init__(self, urdf: str) -> None:
        """Parse the text; raises RobotDescriptionError if it describes no robot."""
        self.pin = floating_model(urdf)
        self._frames = [i for i, f in enumerate(self.pin.frames) if f.type == pin.FrameType.BODY]
        self.links: tuple[str, ...] = tuple(self.pin.frames[index].name for index in self._frames)

    @property
    def arms(self) -> tuple[str, ...]:
        """Return the names of the arms, one per link that is a tool frame."""
        ending = tool_frame("")
        return tuple(link.removesuffix(ending) for link in self.links if link.endswith(ending))

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the joints of the arms, in Pinocchio's order."""
        return tuple(self.pin.names[2:])  # after Pinocchio's universe and the floating joint

    def poses(self, base_in_world: Array, joint_position: Array, joint_names: tuple[str, ...]) -> Array:
        """Return the pose in ``world`` of every link, (T, L, 7) in the order of ``links``.

        ``base_in_world`` is (T, 7) and ``joint_position`` (T, n) rad in the order of ``joint_names``.
        Raises UnknownNameError if the description lacks one of them.
        """
        data = self.pin.createData()
        poses = np.empty((len(base_in_world), len(self._frames), 7))
        for row, q in enumerate(self._configurations(base_in_world, joint_position, joint_names)):
            pin.framesForwardKinematics(self.pin, data, q)
            for place, index in enumerate(self._frames):
                poses[row, place] = pose_row(pose_of(data.oMf[index]))
        return poses

    @property
    def mass(self) -> float:
        """Total mass in kg."""
        return float(pin.computeTotalMass(self.pin))

    def centres_of_mass(
        self, base_in_world: Array, joint_position: Array, joint_names: tuple[str, ...]
    ) -> Array:
        """Return the centre of mass of the robot in ``world``, (T, 3) m; arguments as those of poses."""
        data = self.pin.createData()
        found = self._configurations(base_in_world, joint_position, joint_names)
        return np.array([np.array(pin.centerOfMass(self.pin, data, q)) for q in found])

    def _configurations(
        self, base_in_world: Array, joint_position: Array, joint_names: tuple[str, ...]
    ) -> Iterator[Array]:
        """Yield the configuration (7 + n,) of each row, every time in the same array."""
        columns = joint_columns(self.pin, joint_names)
        q: Array = pin.neutral(self.pin)
        for base, joints in zip(base_in_world, joint_position, strict=True):
            q[:BASE_NQ] = base
            q[columns] = joints
            yield q
