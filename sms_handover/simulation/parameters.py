"""Parameters that the whole loop shares."""

from dataclasses import dataclass, replace

from sms_handover.configuration.parameters import parameter
from sms_handover.errors import ConfigurationError, UnknownNameError
from sms_handover.graph.topics import CONTROLLER, NODES
from sms_handover.units import seconds_to_ns

LOCKSTEP, REALTIME = "lockstep", "realtime"
MODES = (LOCKSTEP, REALTIME)
DIRECT, EXECUTOR = "direct", "executor"
TRANSPORTS = (DIRECT, EXECUTOR)
PINOCCHIO, COMPILED = "pinocchio", "compiled"
DYNAMICS = (PINOCCHIO, COMPILED)
TRUE, MEASURED = "truth", "measured"
SOURCES = (TRUE, MEASURED)
EXTERNAL = (CONTROLLER,)
AFTER, ONLINE = "after", "online"
CLEARANCE = (AFTER, ONLINE)
REPORT, ABORT = "report", "abort"
ON_COLLISION = (REPORT, ABORT)
FAIL = "fail"
ON_TOUCH = (FAIL, REPORT)


@dataclass(frozen=True)
class CommonParameters:
    """Parameters that all nodes share; the values are in ``config/common.yaml``."""

    tick: float = parameter("simulated time between two states", unit="s", minimum=1e-6, maximum=1.0)
    reference_period: float = parameter(
        "simulated time between two joint references", unit="s", minimum=1e-6, maximum=10.0
    )
    duration: float = parameter(
        "simulated time of the run; 0: to the end of the schedule", unit="s", minimum=0.0
    )
    scenario: str = parameter("name of a shipped scenario, or path of a scenario file")
    robot: str = parameter("path of a robot description; empty: that of the scenario")
    schedule: str = parameter("path of a task schedule; empty: that of the scenario")
    conditions: str = parameter(
        "name of shipped conditions, or path of a file of them; empty: those of the scenario"
    )
    values: tuple[str, ...] = parameter(
        "values of robot, deputy, schedule and conditions by dotted path on top of the files, such as "
        "robot.base.mass:=300 or schedule.phases.carry.duration:=30; those of the plant alone begin with "
        "truth, as in truth.robot.base.mass:=264, those of every other node with model"
    )
    seed: int = parameter("what every random number of the run follows from", minimum=0, maximum=2**53)
    source: str = parameter(
        "what trajectory, inverse kinematics and law are given; truth: robot and deputy as they are; "
        "measured: what the sensors of the conditions tell of them",
        choices=SOURCES,
    )
    dynamics: str = parameter(
        "equations of motion; pinocchio: its algorithms; compiled: the same equations as C code, generated "
        "once for this robot: several times faster, needs CasADi and a C compiler",
        choices=DYNAMICS,
    )
    mode: str = parameter(
        "lockstep: every tick waits for its command; realtime: paced by the wall clock", choices=MODES
    )
    clearance: str = parameter(
        "when distances between bodies are measured; after: the run, from its states; online: each reference "
        "period of it too, as topic 'clearance', with an event where bodies collide",
        choices=CLEARANCE,
    )
    on_collision: str = parameter(
        "what becomes of the task when bodies collide; report: it goes on; abort: its phase has failed; "
        "abort sets clearance online",
        choices=ON_COLLISION,
    )
    on_touch: str = parameter(
        "what becomes of the task when the robot touches a deputy with mass that nobody holds, and would "
        "push it away; fail: its phase has failed, and clearance is measured online; report: as on_collision",
        choices=ON_TOUCH,
    )
    contact_depth: float = parameter(
        "depth to which gripper and deputy may enter each other where their contact is declared",
        unit="m",
        minimum=0.0,
        maximum=1.0,
    )
    transport: str = parameter(
        "how a node takes its inputs; direct: from rcl; executor: by the executor of rclpy, which is slower "
        "and uses public interfaces only",
        choices=TRANSPORTS,
    )
    spin: float = parameter(
        "wall time for which plant and controller look for what they await in lock step before they sleep; "
        "it gives way to others, and stops where it does not pay; 0: never",
        unit="s",
        minimum=0.0,
        maximum=0.1,
    )
    cpu: int = parameter("CPU core of the nodes of the loop; -1: any", minimum=-1, maximum=4095)
    priority: int = parameter(
        "real-time priority of the nodes of the loop (SCHED_FIFO), where permitted; 0: none",
        minimum=0,
        maximum=99,
    )
    lock_memory: bool = parameter("lock the memory of the nodes of the loop (mlockall)")
    autostart: bool = parameter(
        "whether a node configures and activates itself; false: by its lifecycle services"
    )
    peers: tuple[str, ...] = parameter("nodes of the graph; the run starts once all have matched")
    external: tuple[str, ...] = parameter(
        "peers from outside this package; only states and commands are required of them",
        choices=EXTERNAL,
    )

    def __post_init__(self) -> None:
        if self.reference_ns % self.tick_ns:
            raise ConfigurationError(
                f"reference_period is {self.reference_period:g} s, must be a multiple of the tick of "
                f"{self.tick:g} s"
            )
        for name in self.peers:
            if name not in NODES:
                raise UnknownNameError("node", name, NODES, "parameter 'peers'")

    @property
    def tick_ns(self) -> int:
        """The tick in ns."""
        return seconds_to_ns(self.tick)

    @property
    def reference_ns(self) -> int:
        """The reference period in ns."""
        return seconds_to_ns(self.reference_period)

    @property
    def uses_measurements(self) -> bool:
        """Whether trajectory, inverse kinematics and law are given what sensors tell."""
        return self.source == MEASURED

    def last_tick(self, task_end_ns: int, *, failed: bool = False) -> int:
        """Return the number of ticks that the run integrates; a failed task ends it early."""
        end_ns = seconds_to_ns(self.duration) if self.duration > 0.0 else task_end_ns
        return (min(end_ns, task_end_ns) if failed else end_ns) // self.tick_ns

    @property
    def measures_clearance(self) -> bool:
        """Whether distances between bodies are measured as the run goes on."""
        return self.clearance == ONLINE or self.aborts_on_collision

    @property
    def aborts_on_collision(self) -> bool:
        """Whether the task fails when bodies collide."""
        return self.on_collision == ABORT

    @property
    def fails_on_touch(self) -> bool:
        """Whether the task fails when the robot touches a deputy that floats."""
        return self.on_touch == FAIL

    def for_deputies(self, *masses: float) -> "CommonParameters":
        """Return the same for a run with deputies of these masses in kg: touches matter only with mass."""
        if not any(masses):
            return replace(self, on_touch=REPORT)
        return replace(self, clearance=ONLINE) if self.fails_on_touch else self

    @property
    def ticks_per_reference(self) -> int:
        """The number of ticks in a reference period."""
        return self.reference_ns // self.tick_ns
