"""Replay in Basilisk: the arms as chains of spinning bodies on a free hub, by its RK4 of a tick."""

from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

import numpy as np
import pinocchio as pin
from Basilisk.architecture import messaging, sysModel
from Basilisk.simulation import spacecraft, spinningBodyNDOFStateEffector
from Basilisk.utilities import SimulationBaseClass

from sms_handover.engines.protocol import Effect, Motion, Replay
from sms_handover.engines.rigid_tree import RigidBody, centre_of_mass, chains, placed, rigid_bodies
from sms_handover.frames import tool_frame
from sms_handover.types import BASE_NQ, BASE_NV, Array

_LACKS = {
    Effect.ROTOR_INERTIA: "its spinning bodies have no rotors",
    Effect.PANELS: "its joints are those of the arms alone",
    Effect.DEPUTY_WRENCHES: "wrenches are not replayed",
    Effect.JOINT_STOPS: "its spinning bodies have no stops",
    Effect.WRENCHES: "it holds a torque in axes of the body, not of the world, over a tick",
    Effect.FRICTION: "its spinning bodies have springs and dampers only",
    Effect.DEPUTY_MASS: "it gives no mass matrix, by which the impulse of a grasp would follow",
}
_TASK = "task"
_FIRST, _SECOND, _THIRD, _LAST = 300, 200, 100, 0  # order within a tick: the highest first


class InBasilisk:
    """Basilisk, given the rigid bodies of the robot's URDF."""

    @property
    def title(self) -> str:
        """Its name and version."""
        return f"Basilisk {version('bsk')}"

    @property
    def lacks(self) -> Mapping[Effect, str]:
        """The effects that it cannot replay, and why."""
        return _LACKS

    def run(self, replay: Replay) -> Motion:
        """Integrate a replay without an effect that it lacks.

        Efforts reach the spinning bodies by messages, from a module of the same task that comes before them:
        a simulation that is stopped each tick takes far longer.
        """
        tick_ns = replay.tick_ns
        craft = _Craft(replay)
        simulation = SimulationBaseClass.SimBaseClass()
        simulation.SetProgressBar(False)
        process = simulation.CreateNewProcess("process")
        process.addTask(simulation.CreateNewTask(_TASK, tick_ns))
        sampler = _Sampler(craft, replay.samples, tick_ns)
        drive = _Drive(craft, replay.efforts, tick_ns)
        for model, priority in (
            (drive, _FIRST),
            *((chain.effector, _SECOND) for chain in craft.chains),
            (craft.spacecraft, _THIRD),
            (sampler, _LAST),
        ):
            simulation.AddModelToTask(_TASK, model, priority)
        simulation.InitializeSimulation()
        simulation.ConfigureStopTime(int(replay.samples[-1]) * tick_ns)
        simulation.ExecuteSimulation()
        return sampler.motion(replay)


class _Chain:
    """One arm: the effector, and which columns of the joint arrays are its bodies."""

    def __init__(self, number: int, bodies: list[RigidBody], columns: list[int], replay: Replay) -> None:
        effector = spinningBodyNDOFStateEffector.SpinningBodyNDOFStateEffector()
        effector.ModelTag = f"arm{number}"
        effector.setNameOfThetaState(f"theta{number}")
        effector.setNameOfThetaDotState(f"thetaDot{number}")
        for body, column in zip(bodies, columns, strict=True):
            segment = spinningBodyNDOFStateEffector.SpinningBody()
            segment.setMass(body.mass)
            segment.setR_ScS_S(_column(body.com))
            segment.setISPntSc_S(body.inertia.tolist())
            axes, origin = body.in_parent
            segment.setDCM_S0P(axes.T.tolist())
            segment.setR_SP_P(_column(origin))
            segment.setSHat_S(_column(body.axis))
            segment.setThetaInit(float(replay.start_q[BASE_NQ + column]))
            segment.setThetaDotInit(float(replay.start_v[BASE_NV + column]))
            segment.setK(0.0)
            segment.setC(0.0)
            effector.addSpinningBody(segment)
        self.effector, self.columns = effector, columns
        self.torques = messaging.ArrayMotorTorqueMsg()
        self.payload = messaging.ArrayMotorTorqueMsgPayload()
        self.torques.write(self.payload)
        effector.motorTorqueInMsg.subscribeTo(self.torques)


class _Craft:
    """The spacecraft with its arms."""

    def __init__(self, replay: Replay) -> None:
        self.bodies = bodies = rigid_bodies(replay.urdf)
        self.columns = [replay.joint_names.index(body.joint) for body in bodies[1:]]
        self.spacecraft = spacecraft.Spacecraft()
        self.spacecraft.ModelTag = "spacecraft"
        hub, root = self.spacecraft.hub, bodies[0]
        hub.mHub = root.mass
        hub.r_BcB_B = _column(root.com)
        hub.IHubPntBc_B = root.inertia.tolist()
        q, v = replay.start_q, replay.start_v
        axes = _matrix(q[3:BASE_NQ])
        joints, rates = q[BASE_NQ:][self.columns], v[BASE_NV:][self.columns]
        frames = placed(bodies, (axes, q[:3]), joints)
        # Basilisk's initial position and velocity are those of the centre of mass of the whole
        at, velocity = centre_of_mass(bodies, frames, (axes @ v[:3], axes @ v[3:BASE_NV]), rates)
        hub.r_CN_NInit, hub.v_CN_NInit = _column(at), _column(velocity)
        turn = q[3:BASE_NQ] if q[6] >= 0.0 else -q[3:BASE_NQ]
        hub.sigma_BNInit = _column(turn[:3] / (1.0 + turn[3]))  # tan(angle / 4)
        hub.omega_BN_BInit = _column(v[3:BASE_NV])
        self.chains = [
            _Chain(number, [bodies[i] for i in chain], [self.columns[i - 1] for i in chain], replay)
            for number, chain in enumerate(chains(bodies))
        ]
        for chain in self.chains:
            self.spacecraft.addStateEffector(chain.effector)


class _Drive(sysModel.SysModel):  # type: ignore[misc]
    """Gives the efforts of each tick to the arms before it is integrated."""

    def __init__(self, craft: _Craft, efforts: Array, tick_ns: int) -> None:
        super().__init__()
        self.ModelTag = "drive"
        self._craft, self._tick_ns = craft, tick_ns
        self._efforts = [efforts[:, chain.columns].tolist() for chain in craft.chains]

    def UpdateState(self, now_ns: int) -> None:
        """Write the efforts of the tick that ends now."""
        tick = now_ns // self._tick_ns - 1
        if tick < 0:
            return
        for chain, efforts in zip(self._craft.chains, self._efforts, strict=True):
            chain.payload.motorTorque = efforts[tick]
            chain.torques.write(chain.payload, now_ns, self.moduleID)


class _Sampler(sysModel.SysModel):  # type: ignore[misc]
    """Takes the states that are to be compared."""

    def __init__(self, craft: _Craft, samples: Any, tick_ns: int) -> None:
        super().__init__()
        self.ModelTag = "sampler"
        self._craft, self._tick_ns = craft, tick_ns
        self._samples = set(samples.tolist())
        self._mass = sum(body.mass for body in craft.bodies)
        self.q: list[Array] = []
        self.linear: list[Array] = []
        self.angular: list[Array] = []

    def UpdateState(self, now_ns: int) -> None:
        """Take a state, and the momenta by Basilisk's own sums."""
        if now_ns // self._tick_ns not in self._samples:
            return
        craft = self._craft.spacecraft
        state = craft.scStateOutMsg.read()
        joints = np.zeros(len(self._craft.columns))
        for number, chain in enumerate(self._craft.chains):
            joints[chain.columns] = np.ravel(craft.dynManager.getStateObject(f"theta{number}").getState())
        sigma = np.array(state.sigma_BN)
        square = float(sigma @ sigma)
        quaternion = np.array([*(2.0 * sigma), 1.0 - square]) / (1.0 + square)
        self.q.append(np.concatenate([state.r_BN_N, quaternion, joints]))
        craft.computeEnergyMomentum(now_ns)
        self.linear.append(self._mass * np.array(state.v_CN_N))
        self.angular.append(np.ravel(craft.totRotAngMomPntC_N))

    def motion(self, replay: Replay) -> Motion:
        """Return what was sampled; tools by the frames that Basilisk was given."""
        bodies, tools = self._craft.bodies, _tools(self._craft.bodies, replay)
        poses: dict[str, list[Array]] = {arm: [] for arm in tools}
        for q in self.q:
            frames = placed(bodies, (_matrix(q[3:BASE_NQ]), q[:3]), q[BASE_NQ:][self._craft.columns])
            for arm, (number, (axes, origin)) in tools.items():
                outer = frames[number]
                place = pin.SE3(outer[0] @ axes, outer[1] + outer[0] @ origin)
                poses[arm].append(pin.SE3ToXYZQUAT(place))
        rows = {arm: np.array(found) for arm, found in poses.items()}
        momenta = np.array(self.linear), np.array(self.angular)
        return Motion(np.array(self.q), rows, *momenta, np.empty((0, 7)), np.empty((0, 6)))


def _tools(bodies: list[RigidBody], replay: Replay) -> Mapping[str, tuple[int, tuple[Array, Array]]]:
    """Return by arm the body that has its tool, and the frame of the tool in it."""
    return {
        arm: (number, body.frames[tool_frame(arm)])
        for arm in replay.arms
        for number, body in enumerate(bodies)
        if tool_frame(arm) in body.frames
    }


def _column(values: Array) -> list[list[float]]:
    """Return a vector as Basilisk takes it."""
    return [[float(value)] for value in values]


def _matrix(quaternion: Array) -> Array:
    """Return the rotation matrix of a quaternion x y z w."""
    return np.asarray(pin.Quaternion(quaternion).matrix())
