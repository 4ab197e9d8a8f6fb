"""How the cost of a tick grows with the arms of the robot, and the cost of a second with the tick."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.results import Result, Table, publish, row
from benchmarks.timing import interleaved
from sms_handover.compiled.dynamics import CompiledComputedTorque
from sms_handover.configuration.package_files import config_file
from sms_handover.control.computed_torque import ComputedTorque
from sms_handover.control.law import LawSetup
from sms_handover.control.nmpc import NMPC, NmpcGains
from sms_handover.control.protocol import Guidance
from sms_handover.model.robot_model import RobotModel
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.plant.integrators import TABLEAUS
from sms_handover.plant.plant_state import InitialState
from sms_handover.simulation.parameters import COMPILED, DYNAMICS
from sms_handover.simulation.scenario import load_parameters, load_scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.simulation.wiring import make_dynamics
from sms_handover.types import JointReference, Pose, TaskPhase
from sms_handover.units import ns_to_seconds

ROUNDS = 25
TICKS = 50  # per round and robot
MOUNTS = ((0.3, 0.0), (-0.3, 0.0), (0.0, 0.3), (0.0, -0.3))  # [m] y and z on the +x face
BENT = (0.0, -0.5, 0.0, -1.7, 0.0, -0.6, 0.0)  # [rad]
TICK_NS = 1_000_000  # [ns] while arms are added
TICK_S = (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4)  # [s]
SIMULATED_S = 1.0  # [s] per round and tick
HOME = Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))

_BASE = """\
name: grown
base: {mass: 240.0, size: [1.0, 1.0, 1.0], com: [0.0, 0.0, 0.0], inertia: uniform_box}  # kg, m
arms:
"""


def robot_with(arms: int, folder: Path) -> RobotModel:
    """Return a robot with a number of the shipped arms."""
    lines = [
        f"  - {{name: arm_{index}, description: {config_file('gen3.yaml')}, "
        f"mount: {{xyz: [0.5, {y}, {z}], rpy: [0.0, 1.5707963267948966, 0.0]}}, "
        "gripper: {mass: 0.6451, radius: 0.05, length: 0.12}, rotor_inertia: [0, 0, 0, 0, 0, 0, 0]}"
        for index, (y, z) in enumerate(MOUNTS[:arms])
    ]
    path = folder / f"robot_{arms}.yaml"
    path.write_text(_BASE + "\n".join(lines) + "\n", encoding="utf-8")
    return RobotModel.load(path)


def ticks_of(robot: RobotModel, dynamics: str) -> Callable[[], None]:
    """Return what lets a robot under NMPC go through ticks of 1 ms towards a reference."""
    joints, parameters = np.tile(BENT, len(robot.arms)), load_parameters().plant
    make = make_dynamics(dynamics, TABLEAUS[parameters.integrator], ns_to_seconds(TICK_NS))
    plant = FreeFloatingPlant(robot, parameters, InitialState(HOME, joints, HOME, {}), TICK_NS, make)
    torque = CompiledComputedTorque if dynamics == COMPILED else ComputedTorque
    controller = NMPC.make(LawSetup(robot, (NmpcGains(1.0, 0),), TICK_NS, computed_torque=torque))
    reference = JointReference(0, joints + 0.1, np.zeros_like(joints))
    controller.guide(Guidance(TaskPhase(0, 0, ""), reference, {}))

    def run() -> None:
        for _ in range(TICKS):
            plant.apply(controller.effort(plant.stamp_ns, plant.q, plant.v))

    return run


def arms_table() -> Table:
    """Return the cost of a tick for one to four arms."""
    with TemporaryDirectory() as folder:
        robots = {arms: robot_with(arms, Path(folder)) for arms in range(1, len(MOUNTS) + 1)}
    runs = {
        f"{arms} {dynamics}": ticks_of(robot, dynamics)
        for arms, robot in robots.items()
        for dynamics in DYNAMICS
    }
    times = interleaved(runs, ROUNDS)
    rows = []
    for name in runs:
        arms, dynamics = name.split()
        joints, seconds = robots[int(arms)].n_joints, times.best(name)
        per_tick = 1e6 * seconds / TICKS
        over_two = seconds / times.best(f"2 {dynamics}")
        rows.append(row(arms, str(joints), dynamics, per_tick, per_tick / joints, over_two))
    heading = ("arms", "joints", "dynamics", "us per tick", "us per tick and joint", "time over two arms")
    return Table(heading, rows, "Plant and NMPC, tick by tick, without inverse kinematics and record:")


def ticks_table() -> Table:
    """Return the cost of a second of the handover for ticks from 4 to 0.25 ms."""
    common = {"duration": SIMULATED_S}
    scenarios = {
        f"{1e3 * tick:g}": load_scenario("paper", {"common": {**common, "tick": tick}}) for tick in TICK_S
    }
    runs = {name: partial(simulate, scenario) for name, scenario in scenarios.items()}
    times = interleaved(runs, ROUNDS // 5)
    rows = []
    for name, scenario in scenarios.items():
        seconds = times.best(name)
        count = SIMULATED_S / scenario.parameters.common.tick
        rows.append(row(name, 1e6 * seconds / count, SIMULATED_S / seconds, seconds / times.best("1")))
    heading = ("tick [ms]", "us per tick", "x real time", "time over 1 ms")
    return Table(heading, rows, "The whole handover in one process, its first second:")


def main() -> None:
    """Measure and publish."""
    publish(
        Result(
            name="growth",
            question="How does the cost grow with arms and with shorter ticks?",
            notes=["All took turns; the shortest time counts."],
            tables=[arms_table(), ticks_table()],
        )
    )


if __name__ == "__main__":
    main()
