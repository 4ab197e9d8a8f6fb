"""The loop as an object: plant, trajectory, inverse kinematics and controller of a scenario, tick by tick."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from sms_handover.compiled.periods import CompiledPeriods, Room
from sms_handover.compiled.ticks import CompiledTicks
from sms_handover.conditions.sensors.suite import SensorSuite
from sms_handover.control.law import Need
from sms_handover.control.plan_events import PlanEvents
from sms_handover.control.protocol import (
    Carrying,
    CheckedController,
    Controller,
    Guidance,
    Planning,
    Showing,
    inner_of,
)
from sms_handover.control.registry import law_named
from sms_handover.errors import ConfigurationError
from sms_handover.graph.events import RunEvent
from sms_handover.graph.topics import CONTROLLER
from sms_handover.plant.applied_values import applied_conditions, applied_text
from sms_handover.plant.sensed_plant import KnownState, SensedPlant, known_of
from sms_handover.simulation.observed_ticks import Observation, Period, Ticks
from sms_handover.simulation.parameters import COMPILED
from sms_handover.simulation.quiet_periods import QuietPeriods, QuietRunner
from sms_handover.simulation.scenario import Scenario, load_scenario
from sms_handover.simulation.snapshot import Snapshot, controller_data, restore_controller
from sms_handover.simulation.wiring import (
    make_controller,
    make_generator,
    make_ik,
    make_monitor,
    make_plant,
    make_runner,
    make_sensors,
)
from sms_handover.types import (
    BaseWrench,
    DeputyState,
    IkStatus,
    JointReference,
    RobotState,
    TaskPhase,
    TickRows,
)


class Loop:
    """A run that is advanced tick by tick, observed, and branched by snapshots.

    A tick: the state is there; each reference period the trajectory gives phase, targets and, by inverse
    kinematics, the joint reference, and the plant executes grasp commands; the controller answers; the plant
    integrates. The last state is answered, but not integrated. Results of grasps and inverse kinematics
    reach the trajectory in the next period. The run integrates ``last_tick`` ticks, other than at first after
    a retry or failure of the task; it is ``finished`` once the last state has been answered.
    """

    def __init__(
        self,
        scenario: Scenario | None = None,
        controller: Controller | None = None,
        base_wrenches: Sequence[BaseWrench] = (),
    ) -> None:
        """Make the loop of a scenario, by default the shipped one; ``controller`` replaces that of its law.

        ``base_wrenches`` act over the ticks of their stamps. Raises ConfigurationError where the scenario
        cannot be run, and where its controller is external and none is given, and MessageError on wrenches of
        one tick or an unknown frame.
        """
        self.scenario = scenario or load_scenario()
        parameters, truth = self.scenario.parameters, self.scenario.truth
        robot, schedule = self.scenario.model.robot, self.scenario.model.schedule
        self._common = parameters.common
        conditions = truth.conditions
        self._unread: SensorSuite | None = None  # made to read back what they have; C does not measure
        if self._common.dynamics == COMPILED and not self._common.uses_measurements:
            self._unread = make_sensors(conditions, truth.robot.n_joints, self._common)
            conditions = replace(conditions, sensors={})  # nobody would listen
        self._plant = make_plant(truth.robot, truth.schedule, self._common, parameters.plant, conditions)
        for wrench in base_wrenches:
            self._plant.push(wrench)
        self._generator = make_generator(robot, schedule, self._common, parameters.trajectory)
        self._find_joints = make_ik(robot, self._common, parameters.ik)
        measured = self._common.measures_clearance
        self._monitor = make_monitor(truth.robot, truth.schedule, self._common) if measured else None
        self._per_reference = self._common.ticks_per_reference
        self._controller: Controller
        if controller is not None:
            self.law, self._aims = type(controller).__qualname__, True
            self._controller = CheckedController(controller, robot.joint_names)
        elif CONTROLLER in self._common.external:
            raise ConfigurationError(
                "the controller is external: give simulate() a controller, "
                "or check a recording with 'sms-handover verify --with plant'"
            )
        else:
            self.law = parameters.controller.law
            self._aims = Need.TOOL_TARGETS in law_named(self.law).needs
            self._controller = make_controller(robot, schedule, self._common, parameters.controller)
        self._solves = self.controller if isinstance(self.controller, Planning) else None
        self._shows = self.controller if isinstance(self.controller, Showing) else None
        self._plan_events = PlanEvents()
        self._runner = make_runner(self._plant, self._controller, robot, self._common, parameters.plant)
        self._quiet: QuietRunner | None = None
        if isinstance(self._runner, CompiledTicks) and not self._monitor:
            periods = CompiledPeriods(self._runner, robot, parameters.ik, self._per_reference)
            self._quiet = QuietRunner(self._plant, self._generator, periods, self._per_reference)
        self.reset()

    def reset(self, seed: int | None = None) -> None:
        """Go back to the start.

        ``seed`` is that of the noise of the run, by default that of the scenario, and is kept by snapshots.
        The robot stays as the scenario has drawn it.
        """
        self.seed = self._common.seed if seed is None else seed
        self._plant.seed(self.seed)
        self._plant.reset()
        self._generator.reset()
        self._controller.reset()
        self._plan_events.reset()
        if self._monitor:
            self._monitor.reset()
        schedule, rest = self.scenario.model.schedule, self._plant.state
        phase = TaskPhase(0, 0, schedule.phases[0].name, end_ns=schedule.end_ns)
        reference = JointReference(0, rest.joint_position, rest.joint_velocity)
        self._guidance = Guidance(phase, reference, {})  # until the first one comes
        self.last_tick = self._common.last_tick(schedule.end_ns)
        self.finished = False

    @property
    def state(self) -> RobotState:
        """The state that the next tick begins with."""
        return self._plant.state

    @property
    def deputy(self) -> DeputyState:
        """The deputy at the same instant."""
        return self._plant.deputy

    @property
    def base_wrenches(self) -> tuple[BaseWrench, ...]:
        """The wrenches that others have asked for and that have acted so far."""
        return tuple(w for w in self._plant.base_wrenches if w.stamp_ns < self._plant.stamp_ns)

    @property
    def applied(self) -> str:
        """What acts in the plant, read back from it, as JSON, with sensors whether or not they are read."""
        return applied_text(self._plant, self._unread)

    @property
    def applied_conditions(self) -> Mapping[str, Any]:
        """The part of :attr:`applied` that files of conditions name, as plain data."""
        return applied_conditions(self._plant, self._unread)

    @property
    def controller(self) -> Controller:
        """What answers the states, without the check of its efforts."""
        return inner_of(self._controller)

    def advance(self) -> Observation:
        """Carry out one tick; raises ConfigurationError after the last one.

        Raises ControllerError unless the efforts of a user's controller are finite.
        """
        (tick,) = self._advance(1).observations
        return tick

    def advance_period(self) -> Ticks:
        """Carry out the ticks up to the next reference period, or to the end of the run."""
        return self._advance(self._per_reference)

    def _advance(self, most: int) -> Ticks:
        """Carry out at most so many ticks, and none beyond the next reference period."""
        plant = self._plant
        if self.finished:
            raise ConfigurationError(f"the run ended at {plant.stamp_ns} ns: reset or restore the loop first")
        since = plant.tick % self._per_reference
        period = None if since else self._begin_period()
        left = self.last_tick - plant.tick
        ticks = min(most, self._per_reference - since, left + 1)
        rows, excesses = self._run(ticks, left)
        report = self._solves.take_status() if self._solves else None
        told = self._plan_events.of(report) if report else ()
        if told:
            excesses = {**excesses, 0: excesses.get(0, ()) + told}
        paths = self._shows.take_paths() if self._shows else None
        return Ticks(rows, excesses, self._guidance, period, report, paths)

    def _run(self, ticks: int, left: int) -> tuple[TickRows, Mapping[int, tuple[RunEvent, ...]]]:
        """Carry out some ticks, with ``left`` still to be integrated; return them with their excesses."""
        plant = self._plant
        first, self.finished = plant.tick, ticks > left
        rows = self._runner.run(ticks, min(ticks, left))
        excesses = plant.take_excesses_of(first, rows)
        if self.finished:
            last = ticks - 1
            excesses[last] = excesses.get(last, ()) + plant.end_excesses()
        return rows, excesses

    def advance_quietly(self, room: Room | None = None) -> Ticks | QuietPeriods:
        """Carry out as many reference periods as there are without a decision, or the next one.

        The rows of quiet periods may be in the ``room`` for them that is returned for a number of ticks.
        """
        if self._quiet and not self.finished and self._plant.tick % self._per_reference == 0:
            quiet = self._quiet.run(self._guidance, self.last_tick, room)
            if quiet:
                for self._guidance in quiet.guidance:
                    self._controller.guide(self._guidance)
                return quiet
        return self._advance(self._per_reference)

    def snapshot(self) -> Snapshot:
        """Return all that the rest of the run depends on besides the scenario.

        Raises ControllerError if the controller does not tell its state.
        """
        controller = controller_data(self._controller, self.law)
        plant, trajectory = self._plant.snapshot(), self._generator.snapshot()
        clearance = self._monitor.snapshot() if self._monitor else None
        return Snapshot(
            self.seed,
            plant,
            trajectory,
            self.law,
            controller,
            self._guidance,
            self.finished,
            clearance,
            self._plan_events.state,
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Go back to a snapshot: the rest of the run is the same bit for bit.

        Under another law than that of the snapshot the controller begins here, with the guidance in force.
        Raises ConfigurationError if the snapshot is of another robot or schedule, or if only one of the two
        deputies has mass.
        """
        self._plant.seed(snapshot.seed)
        self._plant.restore(snapshot.plant)
        self._generator.restore(snapshot.trajectory)
        if self._monitor and snapshot.clearance:
            self._monitor.restore(snapshot.clearance)
        self._guidance, phase = snapshot.guidance, snapshot.guidance.phase
        self.last_tick = self._common.last_tick(phase.end_ns, failed=phase.failed)
        self.seed, self.finished = snapshot.seed, snapshot.finished
        self._controller.reset()
        self._plan_events.reset()
        if snapshot.law == self.law:
            self._plan_events.restore(snapshot.plan)
            restore_controller(self._controller, snapshot.controller)
        elif snapshot.plant.tick:
            self._controller.guide(self._guidance)

    def _begin_period(self) -> Period:
        """Guide the controller and execute the grasp commands of this instant."""
        plant, generator = self._plant, self._generator
        state, deputy = plant.state, plant.deputy
        tools, conserved = plant.tools_in_world, plant.conserved
        measured = known_of(plant) if isinstance(plant, SensedPlant) else None
        known = KnownState(state, deputy.deputy_in_world)
        if measured and self._common.uses_measurements:
            known = measured
        phase, targets = generator.targets(known.state, known.deputy_in_world)
        request = generator.ik_request(known.state, targets)
        asked = bool(request.tool_in_world)
        solution = self._find_joints(request) if asked else None
        joints = solution.joint_position if solution else targets.joint_position
        reference, aims = generator.reference(known.state, targets, joints)
        self._guidance = Guidance(phase, reference, aims if self._aims else {})
        self._controller.guide(self._guidance)
        events = plant.execute(phase.commands)
        generator.grasped(events)
        if isinstance(self._controller, Carrying):
            for event in events:
                self._controller.grasped(event)
        clearance = None
        if self._monitor:
            pose, holder = deputy.deputy_in_world, plant.deputy.holder
            clearance = self._monitor.measure(state.stamp_ns, state.q, pose, phase.index, holder)
            generator.collided(clearance.collisions)
        status = solution.status if solution else None
        if status:
            generator.solved(converged=status is IkStatus.CONVERGED)
        self.last_tick = self._common.last_tick(phase.end_ns, failed=phase.failed)
        decisions = generator.take_decisions()
        return Period(
            phase,
            reference,
            aims,
            tools,
            deputy,
            conserved,
            plant.work,
            plant.external_work,
            plant.losses,
            plant.external_impulse,
            plant.panels,
            status,
            events,
            decisions,
            clearance,
            measured,
        )
