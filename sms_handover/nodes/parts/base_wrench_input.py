"""Base wrench input: what others on the graph ask to act on the base, told to the plant."""

from collections.abc import Callable

from sms_handover.errors import MessageError, Reason
from sms_handover.graph.topics import BASE_WRENCH
from sms_handover.plant.free_floating import FreeFloatingPlant
from sms_handover.ros.codecs.base_wrench import read_base_wrench
from sms_handover.ros.node.node_inputs import NodeInputs
from sms_handover.types import BaseWrench
from sms_handover.units import ns_to_seconds


class BaseWrenchInput:
    """Takes wrenches from whoever publishes them; each waits for the tick of its stamp.

    One whose tick is over, or comes after the end of the run, is rejected and counted, as is one in an
    unknown frame.
    """

    def __init__(self, plant: FreeFloatingPlant, inputs: NodeInputs, end_ns: Callable[[], int]) -> None:
        """Subscribe; ``end_ns`` returns when the last tick of the run ends."""
        self._plant, self._end_ns = plant, end_ns
        inputs.subscribe_to_all(BASE_WRENCH, self._on_wrench, read_base_wrench)

    def _on_wrench(self, wrench: BaseWrench, sent_ns: int) -> None:
        if wrench.stamp_ns >= self._end_ns():
            stamp_s, end_s = ns_to_seconds(wrench.stamp_ns), ns_to_seconds(self._end_ns())
            raise MessageError(Reason.FUTURE, f"stamped {stamp_s:g} s, but the run ends at {end_s:g} s")
        self._plant.push(wrench)
