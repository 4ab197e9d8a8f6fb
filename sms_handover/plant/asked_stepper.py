"""Asked stepper: steps by one stepper, and by another where a wrench on the base is asked for."""

from sms_handover.plant.conditioned_stepper import ResistedStepper
from sms_handover.plant.external_wrenches import Companion, ExternalAccount
from sms_handover.types import Array, BaseWrench


class AskedStepper(ResistedStepper):
    """Steps in C, which has no wrenches that are asked for, and of the ticks with one by Python."""

    def __init__(self, usual: ResistedStepper, with_asked: ResistedStepper) -> None:
        self._usual, self._with_asked = usual, with_asked
        self._latest = usual

    def begin(self, start_ns: int, asked: BaseWrench | None = None) -> None:
        """Tell when the next step begins, and which wrench on the base others ask for in it."""
        self._latest = self._with_asked if asked else self._usual
        self._latest.begin(start_ns, asked)

    def step(self, q: Array, v: Array, effort: Array) -> tuple[Array, Array]:
        """Return q (7 + n,) and v (6 + n,) after a step under joint efforts (n,), as read-only arrays."""
        return self._latest.step(q, v, effort)

    @property
    def lost(self) -> float:
        """Energy in J that friction has taken in the latest step."""
        return self._latest.lost

    def given(self, before: ExternalAccount, companion: Companion | None = None) -> ExternalAccount:
        """Return an account of what wrenches have given, after the latest step."""
        return self._latest.given(before, companion)
