"""Closed loop on a recording: its commands into a live plant, whose states are compared with its own."""

import signal
import tempfile
from pathlib import Path
from time import monotonic

from rclpy.executors import Executor

from sms_handover.analysis.deviation import LargestDeviation, StateDeviation
from sms_handover.bag.info import read_info
from sms_handover.bag.run.ticks import recorded_base_wrenches, recorded_ticks
from sms_handover.configuration.scenario_file import COMMON
from sms_handover.errors import BagError, ConfigurationError, GraphError
from sms_handover.graph.topics import CONTROLLER, PLANT
from sms_handover.launcher.command_replay import PEERS, CommandReplay
from sms_handover.launcher.display import Display
from sms_handover.launcher.domain import reserved_domain
from sms_handover.launcher.launcher import LaunchPlan, graph_environment, joined_graph
from sms_handover.launcher.processes import NodeProcesses
from sms_handover.launcher.recorded_scenario import scenario_in
from sms_handover.model.robot_model import RobotModel
from sms_handover.ros.parameters import as_arguments
from sms_handover.ros.process.network_scope import network_scope_to
from sms_handover.simulation.parameters import LOCKSTEP, TRUE
from sms_handover.simulation.scenario import Scenario
from sms_handover.units import ns_to_seconds

EXIT_SAME, EXIT_DEVIATES = 0, 1

_POLL_S = 0.1  # [s] longest wait for a message before the plant is checked again
_STALL_TIMEOUT_S = 30.0  # [s] of wall time without a new state


def closed_loop(bag: Path, domain_id: int | None) -> int:
    """Replay the commands of a bag, print the largest deviations, and return the exit code."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        try:
            info = read_info(bag)
            scenario = scenario_in(info, folder)
            ticks, wrenches = recorded_ticks(bag), recorded_base_wrenches(bag)
        except BagError as error:
            raise ConfigurationError(str(error)) from error  # exit code 2: what was given cannot be used
        with reserved_domain(domain_id) as domain:
            plan = LaunchPlan(scenario, (), domain, folder, bag=None, scope=network_scope_to(()))
            begin = monotonic()
            for number in (signal.SIGTERM, signal.SIGHUP):
                signal.signal(number, signal.default_int_handler)
            with joined_graph(plan, CONTROLLER) as (node, executor):
                reference_ns = scenario.parameters.common.reference_ns
                replay = CommandReplay(node, ticks, scenario.truth.robot, reference_ns, wrenches)
                with NodeProcesses(folder, graph_environment(plan)) as processes:
                    processes.start(PLANT, ["--ros-args", *_plant_arguments(scenario)])
                    with Display(info.end_ns) as display:
                        _run(replay, executor, processes, display)
    print(f"{replay.deviation.compared} states, wall time {monotonic() - begin:.1f} s")
    if replay.held:
        print(f"{replay.held} ticks without a recorded command: the last one was held")
    print("\n".join(deviation_lines(replay.deviation, scenario.truth.robot)))
    return EXIT_SAME if replay.deviation.first is None and replay.deviation.compared else EXIT_DEVIATES


def deviation_lines(largest: LargestDeviation, robot: RobotModel) -> list[str]:
    """Return the largest deviations in words, with where each was."""
    if largest.first is None:
        return [f"the same bit for bit as recorded: {largest.compared} states"]
    joint, position, angle = largest.joint, largest.base_position, largest.base_angle
    name = robot.joint_names[joint.joint] if joint else ""
    return [
        "largest deviation from the recording",
        f"  joint position    {_value(joint, 'joint_angle')} rad{_at(joint)}, {name}",
        f"  base position     {_value(position, 'base_position')} m{_at(position)}",
        f"  base orientation  {_value(angle, 'base_angle')} rad{_at(angle)}",
        f"first different bit{_at(largest.first)}",
    ]


def _value(deviation: StateDeviation | None, name: str) -> str:
    return f"{0.0 if deviation is None else getattr(deviation, name):.6g}"


def _at(deviation: StateDeviation | None) -> str:
    return "" if deviation is None else f" at {ns_to_seconds(deviation.stamp_ns):.9g} s"


def _plant_arguments(scenario: Scenario) -> list[str]:
    """Return the ROS arguments of a plant that waits for the commands and for no other node."""
    overrides = scenario.overrides
    common = {**overrides.get(COMMON, {}), "mode": LOCKSTEP, "peers": PEERS, "autostart": True}
    common["source"] = TRUE  # the recorded commands answer whatever the law was given
    return as_arguments({**common, **overrides.get(PLANT, {})})


def _run(replay: CommandReplay, executor: Executor, processes: NodeProcesses, display: Display) -> None:
    """Handle events to the end of the run; raises GraphError if the plant died or stalled."""
    seen, since = replay.stamp_ns, monotonic()
    while not replay.done:
        executor.spin_once(timeout_sec=_POLL_S)
        for death in processes.dead():
            raise GraphError(f"the plant {death.how}:\n{death.last_lines}")
        if replay.stamp_ns != seen:
            if seen < 0:
                display.start(replay.stamp_ns)
            seen, since = replay.stamp_ns, monotonic()
            display.show_run(seen)
        elif monotonic() - since > _STALL_TIMEOUT_S:
            waiting = ", ".join(replay.unmatched) or "the next state"
            raise GraphError(f"no state from the plant for {_STALL_TIMEOUT_S:g} s: waiting for {waiting}")
    display.show_run(replay.stamp_ns, last=True)
