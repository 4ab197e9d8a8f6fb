"""Lifecycle node of ROS 2: hooks for what a transition does; an error in one ends the node."""

from collections.abc import Callable, Sequence
from typing import Any

from lifecycle_msgs.msg import State
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn

from sms_handover.ros.process.main import RunnableNode, Stop

_DONE, _FAILED = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.ERROR


class LifecycleNode(LifecycleNodeMixin, RunnableNode):
    """Offers the lifecycle services and ``~/transition_event``, and keeps to what they ask.

    ``ros2 lifecycle`` and the launcher ask by these services, a node that starts itself by
    :meth:`start`. A node overrides the hooks; what :meth:`configure` makes of publishers, services,
    timers and so on is destroyed when the node is cleaned up. An error in a transition goes by
    ErrorProcessing to ``finalized``, and :meth:`should_run` raises it, so that the process ends by it.
    """

    def __init__(self, name: str) -> None:
        RunnableNode.__init__(self, name, automatically_declare_parameters_from_overrides=True)
        LifecycleNodeMixin.__init__(self)
        self._made_before: set[object] = set()
        self._error: Exception | None = None
        self._companions: tuple[LifecycleNode, ...] = ()
        self._change_state = self._service_change_state.callback
        self._service_change_state.callback = self._on_change_state

    # What a node does in a transition

    def configure(self) -> None:
        """Load what the node needs and make its endpoints; raises SmsHandoverError."""

    def activate(self) -> None:
        """Begin to take part in the run, or go on with it."""

    def deactivate(self) -> None:
        """Take no part in the run until activated again, and lose nothing of it."""

    def clean_up(self) -> None:
        """Give back what :meth:`configure` took and what is no entity of ROS."""

    # Where it is

    @property
    def state_name(self) -> str:
        """The state of the lifecycle: unconfigured, inactive, active, finalized or one between."""
        return str(self._state_machine.current_state[1])

    @property
    def active(self) -> bool:
        """Whether the node takes part in the run."""
        return bool(self._state_machine.current_state[0] == State.PRIMARY_STATE_ACTIVE)

    @property
    def finalized(self) -> bool:
        """Whether the node was shut down."""
        return bool(self._state_machine.current_state[0] == State.PRIMARY_STATE_FINALIZED)

    # For the process

    def start(self) -> None:
        """Configure and activate, as an unmanaged node does; raises the error of a transition."""
        for trigger in (self.trigger_configure, self.trigger_activate):
            trigger()
            self._raise_error()

    def destroy_node(self) -> None:
        """Destroy the node with its state machine.

        rclpy 7.1 leaves that until the garbage is collected, and as long as it is there the process goes
        on taking part in the graph, with the half of a service that the others then wait for in vain.
        """
        super().destroy_node()
        self.__dict__.pop("_state_machine", None)

    def accompany(self, others: Sequence[RunnableNode]) -> None:
        """Run until the other nodes of the same process and thread have been shut down too."""
        self._companions = tuple(other for other in others if isinstance(other, LifecycleNode))

    def should_run(self, stop: Stop) -> bool:
        """Whether the loop is to have another turn; raises the error of a transition that failed.

        It ends when it is asked to, or when every node of the process has been shut down.
        """
        nodes = (self, *self._companions)
        for node in nodes:
            node._raise_error()
        return not (stop.asked or all(node.finalized for node in nodes))

    def _raise_error(self) -> None:
        if self._error is not None:
            raise self._error

    # What rclpy calls

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Configure."""
        self._made_before = set(self._entities())
        return self._carry_out(self.configure)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Activate."""
        return self._carry_out(self.activate)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Deactivate."""
        return self._carry_out(self.deactivate)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Clean up."""
        return self._carry_out(self._take_down)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End in order from whatever state."""
        if state.state_id == State.PRIMARY_STATE_UNCONFIGURED:
            return _DONE
        if state.state_id == State.PRIMARY_STATE_ACTIVE and self._carry_out(self.deactivate) is _FAILED:
            return _FAILED
        return self._carry_out(self._take_down)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Give the node up: its parts may be there or not."""
        return TransitionCallbackReturn.FAILURE

    def _on_change_state(self, request: Any, response: Any) -> Any:
        """Answer a request for a transition; one that this state does not have is rejected.

        rclpy 7.1 lets the error of such a request end the process.
        """
        try:
            return self._change_state(request, response)
        except rclpy_implementation.RCLError:
            asked = request.transition.label or request.transition.id
            self.get_logger().warning(f"rejected: no transition {asked!r} leads out of {self.state_name!r}")
            response.success = False
            return response

    def _carry_out(self, act: Callable[[], None]) -> TransitionCallbackReturn:
        """Carry out a transition; its error is kept for :meth:`should_run`, as rclpy drops it."""
        try:
            act()
        except Exception as error:
            self._error = error
            return _FAILED
        return _DONE

    def _take_down(self) -> None:
        """Undo what configuring has made."""
        self.clean_up()
        for entity, destroy in self._entities().items():
            if entity not in self._made_before:
                destroy(entity)

    def _entities(self) -> dict[object, Callable[[Any], object]]:
        """Return everything that an executor serves or that publishes, each with what destroys it."""
        entities: dict[object, Callable[[Any], object]] = {}
        entities.update((publisher, self.destroy_publisher) for publisher in self.publishers)
        entities.update((subscription, self.destroy_subscription) for subscription in self.subscriptions)
        entities.update((client, self.destroy_client) for client in self.clients)
        entities.update((service, self.destroy_service) for service in self.services)
        entities.update((timer, self.destroy_timer) for timer in self.timers)
        return entities
