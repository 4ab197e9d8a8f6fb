"""The breaks of the mutation table: each is one law of the package, broken on purpose."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Break:
    """One edit that makes the package wrong: ``old`` occurs once in ``file`` and becomes ``new``.

    ``likely`` is the test file that is run first.
    """

    name: str
    file: str
    old: str
    new: str
    likely: str


def _core(name: str, file: str, old: str, new: str, likely: str) -> Break:
    """Return a break in the package, its likely test in ``test/core``."""
    return Break(name, f"sms_handover/{file}.py", old, new, f"test/core/test_{likely}.py")


_DESCRIPTION = "test/core/test_robot_description.py"
_PUBLISHED = "test/verification/test_claims_gen3.py"
_LAGRANGE = "test/verification/test_lagrangian.py"

BREAKS: tuple[Break, ...] = (
    # the robot
    Break(
        "centre of mass of the last link on the wrong side",
        "config/gen3.yaml",
        "com: [-0.000093, 0.000132, -0.022905]",
        "com: [-0.000093, -0.000132, -0.022905]",
        _PUBLISHED,
    ),
    Break(
        "two moments of inertia swapped",
        "config/gen3.yaml",
        "inertia: [0.011088, 0.000005, 0.0, 0.001072, -0.000691, 0.011255]",
        "inertia: [0.011088, 0.000005, 0.0, 0.011255, -0.000691, 0.001072]",
        _DESCRIPTION,
    ),
    Break(
        "motor inertia added to every joint",
        "config/robot.yaml",
        "rotor_inertia: &rotor_inertia [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]",
        "rotor_inertia: &rotor_inertia [0.01, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01]",
        _DESCRIPTION,
    ),
    Break(
        "inertia of a box twice too large",
        "sms_handover/model/parts.py",
        "share = mass / 12.0",
        "share = mass / 6.0",
        _DESCRIPTION,
    ),
    Break(
        "inertia of a cylinder from its diameter",
        "sms_handover/model/parts.py",
        "mass * (3.0 * radius**2 + length**2) / 12.0",
        "mass * (12.0 * radius**2 + length**2) / 12.0",
        _DESCRIPTION,
    ),
    _core(
        "numbers of the description rounded to six digits",
        "model/urdf",
        'return " ".join(repr(float(value)) for value in values)',
        'return " ".join(f"{value:.6g}" for value in values)',
        "urdf",
    ),
    # model
    _core(
        "a thousandth of gravity left on",
        "model/robot_model",
        "self.pin.gravity.setZero()",
        "self.pin.gravity.linear = np.array([0.0, 0.0, -0.01])",
        "robot_model",
    ),
    _core(
        "rotor inertia of the description ignored",
        "model/robot_model",
        "self.pin.armature = armature",
        "self.pin.armature = 0.0 * armature",
        "robot_model",
    ),
    _core(
        "angular part of a twist first",
        "types",
        "[twist_base_in_base.linear, twist_base_in_base.angular, joint_velocity]",
        "[twist_base_in_base.angular, twist_base_in_base.linear, joint_velocity]",
        "robot_model",
    ),
    _core(
        "quaternion in the order w x y z",
        "model/poses",
        "return Pose(row[:3], row[3:])",
        "return Pose(row[:3], np.roll(row[3:], 1))",
        "poses",
    ),
    _core(
        "roll and yaw swapped",
        "model/poses",
        "pin.rpy.rpyToMatrix(np.asarray(rpy, dtype=np.float64))",
        "pin.rpy.rpyToMatrix(np.asarray(rpy, dtype=np.float64)[::-1].copy())",
        "poses",
    ),
    _core(
        "Coriolis term of the reduced dynamics dropped",
        "model/reduced",
        "bias=bias[BASE_NV:] - reaction[:, -1],",
        "bias=-reaction[:, -1],",
        "reduced_dynamics",
    ),
    _core(
        "Coriolis term of the inverse dynamics dropped",
        "model/reduced",
        "pin.rnea(robot.pin, robot.data, q, v, accelerations)",
        "pin.rnea(robot.pin, robot.data, q, 0.0 * v, accelerations)",
        "nmpc",
    ),
    _core(
        "reaction of the base with the wrong sign",
        "model/reduced",
        "inertia=inertia[BASE_NV:, BASE_NV:] - reaction[:, :-1],",
        "inertia=inertia[BASE_NV:, BASE_NV:] + reaction[:, :-1],",
        "reduced_dynamics",
    ),
    _core(
        "reaction of the base left out of the efforts",
        "model/reduced",
        "forces[BASE_NV:] - inertia[BASE_NV:, :BASE_NV].dot(yielding)",
        "forces[BASE_NV:]",
        "nmpc",
    ),
    _core(
        "coupling of base and arms left out of J*",
        "model/reduced",
        "own[:, BASE_NV:] + own[:, :BASE_NV] @ reaction for own",
        "own[:, BASE_NV:] for own",
        "reduced_dynamics",
    ),
    _core(
        "block of the mass matrix transposed",
        "model/reduced",
        "inertia[BASE_NV:, :BASE_NV].dot(yielding)",
        "inertia[BASE_NV:, :BASE_NV].T.reshape(-1, BASE_NV).dot(yielding)",
        "nmpc",
    ),
    _core(
        "tool Jacobian at the origin of the world",
        "model/reduced",
        "robot.pin, robot.data, q, robot.tool_frame_id[arm], pin.ReferenceFrame.LOCAL_WORLD_ALIGNED",
        "robot.pin, robot.data, q, robot.tool_frame_id[arm], pin.ReferenceFrame.WORLD",
        "reduced_dynamics",
    ),
    Break(
        "kinetic energy without the rotors",
        "sms_handover/model/conserved.py",
        "energy = 0.5 * float(v.dot(inertia).dot(v))",
        "energy = 0.5 * float(v @ (inertia - np.diag(robot.pin.armature)) @ v)",
        _LAGRANGE,
    ),
    Break(
        "kinetic energy as Pinocchio sums it, rotors of some joints left out",
        "sms_handover/model/conserved.py",
        "energy = 0.5 * float(v.dot(inertia).dot(v))",
        "energy = float(pin.computeKineticEnergy(robot.pin, robot.data, q, v))",
        _LAGRANGE,
    ),
    _core(
        "kinetic energy without its half",
        "model/conserved",
        "energy = 0.5 * float(v.dot(inertia).dot(v))",
        "energy = float(v @ inertia @ v)",
        "robot_model",
    ),
    _core(
        "reaction of the base along with the joints, not against them",
        "model/reduced",
        "reaction: Array = -np.linalg.solve(",
        "reaction: Array = np.linalg.solve(",
        "reduced_dynamics",
    ),
    _core(
        "angular momentum about a wrong point",
        "model/conserved",
        "np.array(momentum.linear), np.array(momentum.angular)",
        "np.array(momentum.linear), np.array(momentum.angular + np.cross(q[:3], momentum.linear))",
        "robot_model",
    ),
    # plant
    _core(
        "joint damping of 0.04 N m s/rad",
        "plant/stepper",
        "q, v, self._generalized, _IN_WORLD",
        "q, v, self._generalized - 0.04 * np.r_[np.zeros(BASE_NV), v[BASE_NV:]], _IN_WORLD",
        "plant",
    ),
    # compiled dynamics
    _core(
        "compiled: the momentum of a body left out of its moment",
        "compiled/rigid_bodies",
        "moment += ca.cross(angular, spin) + ca.cross(linear, momentum)",
        "moment += ca.cross(angular, spin)",
        "compiled_dynamics",
    ),
    _core(
        "compiled: rotors left out of the mass matrix",
        "compiled/rigid_bodies",
        "matrix[joint][joint] += self._bodies[index].rotor",
        "matrix[joint][joint] += 0.0",
        "compiled_dynamics",
    ),
    _core(
        "compiled: weights of a scheme taken from its first motion alone",
        "compiled/step",
        "total = [sum(weights) for weights in zip(*tableau.b, strict=True)]",
        "total = list(tableau.b[0])",
        "compiled_dynamics",
    ),
    _core(
        "compiled: a library is not held against Pinocchio",
        "compiled/dynamics",
        "if not apart <= _TOLERANCE:",
        "if not apart <= 1e9:",
        "compiled_dynamics",
    ),
    _core(
        "effort limits inverted",
        "model/robot_model",
        "np.minimum(np.maximum(effort, self._least_effort), self.effort_limit)",
        "np.maximum(np.minimum(effort, self._least_effort), self.effort_limit)",
        "plant",
    ),
    _core(
        "work counted against the motion",
        "plant/free_floating",
        "self._work += float(effort.dot",
        "self._work -= float(effort.dot",
        "plant",
    ),
    _core(
        "stamp of a state off by one tick",
        "plant/free_floating",
        "return self._tick * self._tick_ns",
        "return (self._tick + 1) * self._tick_ns",
        "plant",
    ),
    _core(
        "state reports the effort asked for, not the one given",
        "plant/free_floating",
        "self.q, self.v, self.joint_effort = q, v, effort",
        "self.q, self.v, self.joint_effort = q, v, asked",
        "plant",
    ),
    _core(
        "two weights of the fourth-order scheme swapped",
        "plant/integrators",
        "(1 / 4, 1 / 6, 1 / 6, -1 / 12)",
        "(1 / 4, 1 / 6, -1 / 12, 1 / 6)",
        "integrators",
    ),
    _core(
        "a step of the fourth-order scheme as one motion instead of two",
        "plant/integrators",
        "((1 / 4, 1 / 6, 1 / 6, -1 / 12), (-1 / 12, 1 / 6, 1 / 6, 1 / 4))",
        "((1 / 6, 1 / 3, 1 / 3, 1 / 6),)",
        "integrators",
    ),
    _core(
        "the two motions of a step in the wrong order",
        "plant/integrators",
        "for motion in self._motions:",
        "for motion in reversed(self._motions):",
        "integrators",
    ),
    _core(
        "the last stage of the fourth-order scheme set out from the start",
        "plant/integrators",
        "(0, 0, 0, 1)",
        "(0, 0, 0, 0)",
        "integrators",
    ),
    _core(
        "forward dynamics worked out once more than a step needs",
        "plant/integrators",
        "rows[1] = acceleration(start, v)",
        "rows[1] = 0.5 * (acceleration(start, v) + acceleration(start, v))",
        "work_counts",
    ),
    _core(
        "grasp tolerance ignored",
        "plant/grasping",
        "if not errors.within(tolerance):",
        "if not errors.within(tolerance) and False:",
        "grasping",
    ),
    _core(
        "release accepted from an arm that does not hold",
        "plant/grasping",
        "command.action is GraspAction.RELEASE and holder != command.arm",
        "command.action is GraspAction.RELEASE and not holder",
        "grasping",
    ),
    _core(
        "angle of a grasp not looked at",
        "plant/deputy",
        "and self.angle <= tolerance.angle",
        "and self.angle <= tolerance.angle + 10.0",
        "grasping",
    ),
    _core(
        "lever arm of the held deputy with the wrong sign",
        "plant/deputy",
        "_cross(tool_twist_in_world.angular, lever)",
        "_cross(lever, tool_twist_in_world.angular)",
        "deputy",
    ),
    _core(
        "deputy that is let go stands still",
        "plant/deputy",
        "self._drifted_s += duration",
        "self._drifted_s += 0.0 * duration",
        "deputy",
    ),
    _core(
        "speed of a turning grasp frame with the wrong sign",
        "plant/deputy",
        "_cross(self._twist.angular, lever)",
        "_cross(lever, self._twist.angular)",
        "deputy",
    ),
    _core(
        "relative pose of a grasp inverted",
        "plant/deputy",
        "se3_of(tool_in_world).actInv(self._pose())",
        "self._pose().actInv(se3_of(tool_in_world))",
        "deputy",
    ),
    # control
    _core(
        "T_r off by 10 %",
        "control/nmpc",
        "(12.0 * self.rolling_period**2)",
        "(12.0 * (1.1 * self.rolling_period) ** 2)",
        "nmpc",
    ),
    _core(
        "velocity gain of order 0 for every order",
        "control/nmpc",
        "return (r + 1) * (r + 5) / (2.0 * self.rolling_period)",
        "return 5.0 / (2.0 * self.rolling_period) + 0.0 * r",
        "nmpc",
    ),
    _core(
        "NMPC error q_d - q",
        "control/nmpc",
        "np.subtract(q[BASE_NQ:], desired[0], out",
        "np.subtract(desired[0], q[BASE_NQ:], out",
        "nmpc",
    ),
    _core(
        "desired acceleration left out",
        "control/nmpc",
        "wanted = desired[2] - self",
        "wanted = 0.0 * desired[2] - self",
        "nmpc",
    ),
    _core(
        "NMPC efforts not limited",
        "control/nmpc",
        "return self._robot.limited(self._inverse_dynamics(q, v, wanted))",
        "return self._inverse_dynamics(q, v, wanted)",
        "nmpc",
    ),
    _core(
        "PID pushes with the rate",
        "control/pid",
        "+ gains.derivative * error_rate",
        "- gains.derivative * error_rate",
        "pid",
    ),
    _core(
        "anti-windup lost",
        "control/pid",
        "np.where(winds_up, 0.0, error * dt)",
        "error * dt",
        "pid",
    ),
    _core(
        "integral counts ticks of 1 ms whatever the tick",
        "control/pid",
        "np.where(winds_up, 0.0, error * dt)",
        "np.where(winds_up, 0.0, error * 1e-3)",
        "pid",
    ),
    _core(
        "integral effort jumps when the gains change",
        "control/pid",
        "self._integral *= self._gains.integral / gains.integral",
        "self._integral *= gains.integral / self._gains.integral",
        "pid",
    ),
    _core(
        "half of the acceleration term of the reference missing",
        "control/reference_track",
        "forward[0, 2] = 0.5 * s * s",
        "forward[0, 2] = 0.25 * s * s",
        "reference_track",
    ),
    _core(
        "gains of a phase never taken over",
        "control/controller",
        "self._law.use(self._gains_by_phase[phase.index])",
        "self._law.use(self._gains_by_phase[0])",
        "controller",
    ),
    _core(
        "unstable gains let through",
        "control/stability",
        "return self.spectral_radius < 1.0 - ROUNDING",
        "return self.spectral_radius < 1.01 - ROUNDING",
        "stability",
    ),
    _core(
        "difference of references taken across phases",
        "control/controller",
        "self._track.restart()",
        "self._track.restart",
        "controller",
    ),
    # inverse kinematics
    _core(
        "constant damping of 0.04",
        "ik/levenberg_marquardt",
        "damping = residual.energy + bias * _DAMPING_GROWTH**growth",
        "damping = 0.04 + bias * _DAMPING_GROWTH**growth",
        "ik",
    ),
    _core(
        "joint limits not kept",
        "ik/levenberg_marquardt",
        "candidate = frozen(robot.within_limits(q - step))",
        "candidate = q - step",
        "ik",
    ),
    _core(
        "joints at a limit not frozen",
        "ik/levenberg_marquardt",
        "(at_lower & (gradient > 0)) | (at_upper & (gradient < 0))",
        "at_lower & at_upper",
        "ik",
    ),
    _core(
        "steps taken that make the error larger",
        "ik/levenberg_marquardt",
        "if found.energy < residual.energy:",
        "if found.energy < residual.energy + 10.0:",
        "ik",
    ),
    _core(
        "orientation not asked for",
        "ik/levenberg_marquardt",
        "and residual.orientation_error <= parameters.orientation_tolerance",
        "and residual.orientation_error <= parameters.orientation_tolerance + 10.0",
        "ik",
    ),
    _core(
        "derivative of the logarithm taken as the identity",
        "ik/residual",
        "to_rows[3:, 3:] = pin.Jlog3(target.actInv(tool).rotation)",
        "to_rows[3:, 3:] = np.eye(3)",
        "ik",
    ),
    _core(
        "rotation of the tool transposed in the Jacobian",
        "ik/residual",
        "to_rows[:3, :3] = tool.rotation",
        "to_rows[:3, :3] = tool.rotation.T",
        "ik",
    ),
    _core(
        "base not locked where it is",
        "trajectory/generator",
        "return IkRequest(state.base_in_world, targets",
        "return IkRequest(self._schedule.base_in_world, targets",
        "generator",
    ),
    # trajectory and schedule
    _core(
        "a phase begins one stamp late",
        "trajectory/schedule",
        "if phase.start_ns <= stamp_ns",
        "if phase.start_ns < max(stamp_ns, 1)",
        "generator",
    ),
    _core(
        "wrong coefficient of the quintic",
        "trajectory/time_law",
        "x**3 * (10.0 + x * (-15.0 + 6.0 * x))",
        "x**3 * (10.0 + x * (-14.0 + 5.0 * x))",
        "time_law",
    ),
    _core(
        "path turns about the axes of the world",
        "trajectory/pose_path",
        "start.rotation.dot(pin.exp3(progress.fraction * turn))",
        "pin.exp3(progress.fraction * turn).dot(start.rotation)",
        "pose_path",
    ),
    _core(
        "grasp commands repeated every period",
        "trajectory/task_progress",
        "self._begin(index) if begins and not self._failed else ()",
        "(self._begin(index) if begins and not self._failed else ()) or phase.commands",
        "generator",
    ),
    _core(
        "offset from the grasp frame ignored",
        "trajectory/generator",
        "se3_of(frame) * se3_of(target.tool_in_grasp_frame))",
        "se3_of(frame))",
        "generator",
    ),
    _core(
        "motion of the other arm left out of the rates",
        "trajectory/generator",
        "rest = wanted - jacobian @ velocity",
        "rest = wanted - 0.0 * jacobian @ velocity",
        "generator",
    ),
    _core(
        "seconds cut down to nanoseconds",
        "units",
        "return round(seconds * NS_PER_S)",
        "return int(seconds * NS_PER_S)",
        "units",
    ),
    # recorder and bag
    _core(
        "ledger that never counts gaps",
        "bag/counting",
        "if self.period_ns and start <= end:",
        "if self.period_ns and start <= end and False:",
        "bag_ledger",
    ),
    _core(
        "ledger off by one in every gap",
        "bag/counting",
        "(end - start) // self.period_ns + 1 for",
        "(end - start) // self.period_ns for",
        "bag_ledger",
    ),
    _core(
        "log time is the wall time",
        "bag/recording",
        "self.writer.write(topic, data, time_ns, wall_ns)\n                self._keeper",
        "self.writer.write(topic, data, wall_ns, wall_ns)\n                self._keeper",
        "bag_writer",
    ),
    _core(
        "stamp without its nanoseconds",
        "bag/stamp",
        "return int(seconds) * NS_PER_S + int(nanoseconds)",
        "return int(seconds) * NS_PER_S + 0 * int(nanoseconds)",
        "bag_ledger",
    ),
    _core(
        "messages held back until the end",
        "bag/writer",
        "if log_time_ns - self._flushed_ns >= self._flush_period_ns:",
        "if log_time_ns - self._flushed_ns >= 10**6 * self._flush_period_ns:",
        "bag_reader",
    ),
    _core(
        "command recorded as the effort that acted",
        "simulation/recorder",
        "self._effort[k] = effort",
        "self._effort[k] = command",
        "analysis_runs",
    ),
)
