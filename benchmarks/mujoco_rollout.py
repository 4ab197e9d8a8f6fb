"""MuJoCo rollout: a recorded handover replayed on several threads by MuJoCo's own loop in C."""

from collections.abc import Callable
from functools import partial

import mujoco
import numpy as np
from mujoco import rollout

from sms_handover.engines.mujoco_robot import MujocoRobot
from sms_handover.simulation.scenario import Scenario
from sms_handover.simulation.simulate import simulate
from sms_handover.types import BASE_NQ, BASE_NV

THREADS = 2  # [-] with one case each
_SAME = 1e-6  # [rad] between the ends of both, else it is another motion


def replay_of(scenario: Scenario) -> Callable[[], object]:
    """Return what replays the efforts of a scenario without its law, by RK4 with its tick, a case per thread.

    Raises ValueError if it ends elsewhere than the run.
    """
    run, robot = simulate(scenario), MujocoRobot.of(scenario.truth.robot.description)
    model = robot.model
    model.opt.timestep, model.opt.integrator = (
        scenario.parameters.common.tick,
        mujoco.mjtIntegrator.mjINT_RK4,
    )
    robot.place(np.concatenate([run.base_pose[0], run.joint_position[0]]), np.zeros(model.nv))
    physics, applied = mujoco.mjtState.mjSTATE_FULLPHYSICS, mujoco.mjtState.mjSTATE_QFRC_APPLIED
    start = np.zeros(mujoco.mj_stateSize(model, physics))
    mujoco.mj_getState(model, robot.data, start, physics)
    efforts = np.zeros((1, len(run.tick_ns) - 1, model.nv))
    efforts[0, :, BASE_NV:] = run.joint_effort[1:]  # each acted up to its state
    starts = np.repeat(start[np.newaxis], THREADS, axis=0)
    data = [mujoco.MjData(model) for _ in range(THREADS)]
    replay = partial(rollout.rollout, model, data, starts, efforts, control_spec=applied)
    states, _ = replay()
    joints = states[0, -1, 1 + BASE_NQ : 1 + model.nq]  # behind the time
    if np.abs(joints - run.joint_position[-1]).max() > _SAME:
        raise ValueError("the rollout ends elsewhere than the run")
    return replay
