"""Our plant and controller, MuJoCo and Drake, each going through the handover task tick by tick."""

from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from benchmarks.handover_task import HandoverTask, NmpcTracker, State
from sms_handover.control.protocol import Guidance
from sms_handover.engines.mujoco_robot import MujocoRobot, rotation_matrix
from sms_handover.plant.integrators import Tableau
from sms_handover.simulation.wiring import make_controller, make_dynamics, make_plant
from sms_handover.types import BASE_NQ, BASE_NV, Array


class Ours:
    """The plant and the controller of this package, as ``simulate`` uses them."""

    def __init__(self, task: HandoverTask, tableau: Tableau, dynamics: str, steps: int = 1) -> None:
        """Integrate each tick by a scheme in some steps."""
        parameters, robot, schedule = (
            task.scenario.parameters,
            task.scenario.truth.robot,
            task.scenario.truth.schedule,
        )
        common = replace(parameters.common, dynamics=dynamics)
        short = replace(common, tick=task.tick_s / steps)
        self._plant = make_plant(robot, schedule, short, parameters.plant)
        self._plant._stepper = make_dynamics(dynamics, tableau, short.tick)(robot).stepper
        self._controller = make_controller(robot, schedule, common, parameters.controller)
        self._task, self._steps = task, steps
        self._ticks, self._tick_ns = parameters.common.ticks_per_reference, parameters.common.tick_ns

    def period(self, index: int) -> None:
        """Take a reference and go through its ticks."""
        plant, controller, steps = self._plant, self._controller, range(self._steps)
        controller.guide(Guidance(self._task.run.phases[index], self._task.references[index], {}))
        start_ns = self._task.references[index].stamp_ns
        for tick in range(self._ticks):
            effort = controller.effort(start_ns + tick * self._tick_ns, plant.q, plant.v)
            for _ in steps:
                plant.apply(effort)

    @property
    def state(self) -> State:
        """The state it is in."""
        return self._plant.q, self._plant.v


class InMujoco:
    """MuJoCo: H and c by ``mj_step1``, the tick by ``mj_step``."""

    def __init__(self, task: HandoverTask, integrator: str, steps: int = 1) -> None:
        """Integrate each tick by an integrator of MuJoCo in some steps."""
        self._robot = MujocoRobot.of(task.scenario.truth.robot.description)
        self._robot.model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
        self._robot.model.opt.timestep = task.tick_s / steps
        self._robot.place(*task.start)
        self._tracker = NmpcTracker(task)
        self._inertia = np.zeros((self._robot.model.nv, self._robot.model.nv))
        self._steps = steps
        self._ticks, self._tick_ns = (
            task.scenario.parameters.common.ticks_per_reference,
            task.scenario.parameters.common.tick_ns,
        )

    def period(self, index: int) -> None:
        """Take a reference and go through its ticks."""
        model, data, inertia = self._robot.model, self._robot.data, self._inertia
        position, velocity = data.qpos[BASE_NQ:], data.qvel[BASE_NV:]  # views: MuJoCo writes into them
        bias, applied = data.qfrc_bias, data.qfrc_applied[BASE_NV:]
        start_ns = self._tracker.take(index)
        for tick in range(self._ticks):
            mujoco.mj_step1(model, data)
            mujoco.mj_fullM(model, data, inertia)
            stamp_ns = start_ns + tick * self._tick_ns
            applied[:] = self._tracker.effort(stamp_ns, position, velocity, inertia, bias)
            mujoco.mj_step(model, data, self._steps)

    @property
    def state(self) -> State:
        """The state it is in."""
        return self._robot.state


class InDrake:
    """Drake: H and c by the continuous plant, the tick by its simulator with a fixed step."""

    def __init__(self, task: HandoverTask, scheme: str, steps: int = 1) -> None:
        """Integrate each tick by a scheme of Drake in some steps."""
        robot = task.scenario.truth.robot
        self._plant: Any = MultibodyPlant(0.0)
        Parser(self._plant).AddModelsFromString(robot.urdf, "urdf")
        self._plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
        self._plant.Finalize()
        self._simulator = Simulator(self._plant)
        config = SimulatorConfig(
            integration_scheme=scheme, max_step_size=task.tick_s / steps, use_error_control=False
        )
        ApplySimulatorConfig(config, self._simulator)
        self._context = self._simulator.get_mutable_context()
        q, _ = task.start
        there: Any = np.concatenate([q[6:7], q[3:6], q[:3], q[BASE_NQ:]])
        self._plant.SetPositions(self._context, there)
        port = self._plant.get_applied_generalized_force_input_port()
        self._force = np.zeros(self._plant.num_velocities())
        self._applied = port.FixValue(self._context, self._force)
        self._simulator.Initialize()
        self._tracker, self._task = NmpcTracker(task), task

    def period(self, index: int) -> None:
        """Take a reference and go through its ticks."""
        plant, context, common = self._plant, self._context, self._task.scenario.parameters.common
        start_ns = self._tracker.take(index)
        for tick in range(common.ticks_per_reference):
            stamp_ns = start_ns + tick * common.tick_ns
            position = plant.GetPositions(context)[BASE_NQ:]
            velocity = plant.GetVelocities(context)[BASE_NV:]
            inertia, bias = plant.CalcMassMatrix(context), plant.CalcBiasTerm(context)
            self._force[BASE_NV:] = self._tracker.effort(stamp_ns, position, velocity, inertia, bias)
            self._applied.GetMutableData().get_mutable_value().SetFromVector(self._force)
            self._simulator.AdvanceTo((stamp_ns + common.tick_ns) * 1e-9)

    @property
    def state(self) -> State:
        """The state it is in; Drake has the quaternion first, and both base velocities in world axes."""
        at, rates = self._plant.GetPositions(self._context), self._plant.GetVelocities(self._context)
        q = np.concatenate([at[4:7], at[1:4], at[:1], at[BASE_NQ:]])
        to_body: Array = rotation_matrix(q[3:BASE_NQ]).T
        return q, np.concatenate([to_body @ rates[3:6], to_body @ rates[:3], rates[BASE_NV:]])
