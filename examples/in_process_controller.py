"""A custom control law in one process, without ROS, compared with NMPC."""

import numpy as np

from sms_handover.analysis.table import comparison_table
from sms_handover.control.protocol import Guidance
from sms_handover.model.reduced import reduced_dynamics
from sms_handover.model.robot_model import RobotModel
from sms_handover.simulation.scenario import load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.types import BASE_NQ, BASE_NV, Array


class JointPd:
    """u = -m (w^2 e + 2 w q_m'): a critically damped spring per joint, m its effective inertia."""

    def __init__(self, robot: RobotModel, frequency: float = 1.0) -> None:
        """Set up the law for a robot, with the frequency w in rad/s."""
        self._robot, self._frequency = robot, frequency

    def reset(self) -> None:
        """Do nothing: the law has no state."""

    def guide(self, guidance: Guidance) -> None:
        """Set the desired joint angles (n,) rad."""
        self._desired = guidance.reference.position

    def effort(self, stamp_ns: int, q: Array, v: Array) -> Array:
        """Return the joint efforts (n,) N m."""
        inertia = np.diag(reduced_dynamics(self._robot, q, v).inertia)  # of each joint, on the free base
        error, rate, w = q[BASE_NQ:] - self._desired, v[BASE_NV:], self._frequency
        return self._robot.limited(-inertia * (w**2 * error + 2.0 * w * rate))


def main() -> None:
    """Run the shipped handover under both laws and print the results side by side."""
    scenario = load_scenario()
    runs = {
        "joint_pd": simulate(scenario, controller=JointPd(scenario.truth.robot)),
        "nmpc": simulate(scenario),
    }
    print(comparison_table(runs, tolerance=scenario.parameters.plant.grasp_tolerance))


if __name__ == "__main__":
    main()
