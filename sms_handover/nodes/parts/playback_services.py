"""The services that control a playback, named as those of rosbag2's player."""

from collections.abc import Callable
from time import monotonic_ns
from typing import Any

from rclpy.node import Node
from sms_handover_interfaces.srv import Seek, SetRate
from std_srvs.srv import Trigger

from sms_handover.errors import ConfigurationError
from sms_handover.messages.values import time_ns
from sms_handover.playback.schedule import PlaybackSchedule


def offer_services(node: Node, schedule: PlaybackSchedule, stop: Callable[[], None]) -> None:
    """Offer the services of a playback on a node; ``stop`` ends it."""
    simple: dict[str, Callable[[Any], None]] = {
        "pause": lambda request: schedule.pause(monotonic_ns()),
        "resume": lambda request: schedule.resume(monotonic_ns()),
        "toggle_paused": lambda request: schedule.toggle(monotonic_ns()),
        "play_next": lambda request: _play_next(schedule),
        "stop": lambda request: stop(),
    }
    for name, act in simple.items():
        node.create_service(Trigger, f"~/{name}", _answering(act))
    seek = _answering(lambda request: schedule.seek(time_ns(request.time), monotonic_ns()))
    node.create_service(Seek, "~/seek", seek)
    rate = _answering(lambda request: schedule.set_rate(request.rate, monotonic_ns()))
    node.create_service(SetRate, "~/set_rate", rate)


def _play_next(schedule: PlaybackSchedule) -> None:
    """Have one message sent; raises ConfigurationError if that is not possible."""
    if not schedule.step():
        raise ConfigurationError("only a playback that is paused, and not at its end, can step")


def _answering(act: Callable[[Any], None]) -> Callable[[Any, Any], Any]:
    """Return the callback of a service that answers whether something could be done, and if not, why."""

    def callback(request: Any, response: Any) -> Any:
        try:
            act(request)
            response.success = True
        except ConfigurationError as error:
            response.message = str(error)
        return response

    return callback
