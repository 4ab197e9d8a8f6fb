"""Run control: the services by which a run is paused, stepped, reset and ended, each at any time."""

from typing import Any, Protocol

from rclpy.node import Node
from sms_handover_interfaces.msg import RunState
from sms_handover_interfaces.srv import StepTicks
from std_srvs.srv import SetBool, Trigger

from sms_handover.ros.codecs.convert import time_message

_OVER = "the run is over; call ~/reset to start it again"


class ControlledRun(Protocol):
    """What the services ask of the plant, and what they do with it."""

    run_state: int  # one of RunState
    runs: int  # that have begun
    lockstep: bool

    @property
    def active(self) -> bool:
        """Whether the plant takes part in the run."""

    @property
    def recorder_has_ended(self) -> bool:
        """Whether the run has a recorder, but its process has ended."""

    def ticks_to(self, most: int) -> tuple[int, int]:
        """Return how many ticks of so many there are to the end, and the time of the last of them in ns."""

    def enter(self, state: int, detail: str) -> None:
        """Change the state of the run and publish it."""

    def advance(self) -> None:
        """Go on if what the tick waits for has come."""

    def restart(self) -> None:
        """End this run and begin the next."""

    def finish(self, detail: str) -> None:
        """End the run at this tick."""


class RunControl:
    """Holds what has been requested, and answers the services.

    ``paused`` is the latest request, whether or not the run could follow yet; ``steps_left`` counts the
    ticks that a paused run is still to do; ``finish_asked`` is an end that waits for the start.
    """

    def __init__(self, node: Node, run: ControlledRun) -> None:
        """Offer the services on a node."""
        self._run = run
        self.paused = self.finish_asked = False
        self.steps_left = 0
        node.create_service(SetBool, "~/pause", self._on_pause)
        node.create_service(StepTicks, "~/step", self._on_step)
        node.create_service(Trigger, "~/reset", self._on_reset)
        node.create_service(Trigger, "~/finish", self._on_finish)

    @property
    def first_state(self) -> int:
        """The state in which a run begins."""
        return int(RunState.PAUSED if self.paused else RunState.RUNNING)

    @property
    def holds(self) -> bool:
        """Whether the run may not go on."""
        state = self._run.run_state
        return not (state == RunState.RUNNING or (state == RunState.PAUSED and self.steps_left))

    def reset_run(self) -> None:
        """Forget the steps of the run before; a run that was paused begins paused."""
        self.steps_left = 0
        self.finish_asked = False

    def stepped(self) -> None:
        """Count a step; the last one pauses the run again."""
        self.steps_left -= 1
        if self.steps_left == 0:
            self._run.enter(RunState.PAUSED, "stepped")

    @property
    def _is_over(self) -> bool:
        return self._run.run_state in (RunState.FINISHED, RunState.FAILED)

    def _on_pause(self, request: Any, response: Any) -> Any:
        """Pause or resume, now or from the start of a run that has not started."""
        if self._is_over:
            return _reject(response, _OVER)
        run, self.paused, self.steps_left = self._run, request.data, 0
        response.success = True
        if run.run_state == RunState.WAITING:
            response.message = "it will start paused" if self.paused else "it starts when every node is ready"
        elif not run.active:
            what = "stays paused" if self.paused else "resumes"
            response.message = f"the plant is inactive; the run {what} when it is activated"
        elif self.paused and run.run_state == RunState.RUNNING:
            run.enter(RunState.PAUSED, "on request")
        elif not self.paused and run.run_state == RunState.PAUSED:
            run.enter(RunState.RUNNING, "")
            run.advance()
        return response

    def _on_step(self, request: Any, response: Any) -> Any:
        """Let a paused run do some ticks, after those requested before."""
        run = self._run
        steps, stamp_ns = run.ticks_to(self.steps_left + request.ticks)
        rejections = {
            _OVER: self._is_over,
            "in real time the wall clock says when a tick is due; steps need lock step": not run.lockstep,
            "only a paused run can step; call ~/pause first": not self.paused,
            "the plant is inactive; activate it first": not run.active,
            "ticks is 0, must be >= 1": request.ticks == 0,
            "the last tick has been reached; resume to end the run": steps == self.steps_left,
        }
        for reason, holds in rejections.items():
            if holds:
                return _reject(response, reason)
        self.steps_left = steps
        response.success = True
        response.stamp = time_message(stamp_ns)
        run.advance()
        return response

    def _on_reset(self, request: Any, response: Any) -> Any:
        """Start the run again as soon as every node has reset."""
        response.success = True
        if self._run.run_state == RunState.WAITING:
            response.message = "the run has not started yet"
        elif self._run.recorder_has_ended:
            return _reject(response, "the run is over, and its recorder has closed the bag and ended")
        else:
            self._run.restart()
        return response

    def _on_finish(self, request: Any, response: Any) -> Any:
        """End the run at this tick."""
        if self._is_over:
            return _reject(response, "the run is over already")
        response.success = True
        if self._run.run_state == RunState.WAITING and self._run.runs:
            self.finish_asked = True  # the recorder is between two bags
            response.message = "it ends as soon as the nodes are ready to start it"
        else:
            self._run.finish("stopped on request")
        return response


def _reject(response: Any, reason: str) -> Any:
    """Return the response of a service that rejects its request."""
    response.success, response.message = False, reason
    return response
