"""Queue of plans: the one in use, and the one that takes its place when it begins."""

from sms_handover.control.mpc.plan import Plan


class PlanQueue:
    """Takes plans by their number, never by the order in which they come.

    ``late`` counts plans that were not there when they were to begin, ``reused`` periods in which an older
    plan was carried on.
    """

    def __init__(self) -> None:
        self.restore(None, None, 0)

    def restore(self, plan: Plan | None, coming: Plan | None, reused: int) -> None:
        """Go back to former plans and counts; those of the start of a run are None and 0."""
        self.plan, self.coming = plan, coming
        self.late, self.reused = 0, reused
        self._missed = -1  # number of the latest plan that is late

    def offer(self, plan: Plan) -> bool:
        """Take a plan unless one of the same or a later number is there; return whether it is used."""
        newest = self.coming or self.plan
        if newest is not None and plan.number <= newest.number:
            return False
        if self.plan is None:
            self.plan = plan
        else:
            self.coming = plan
        return True

    def advance(self, stamp_ns: int) -> None:
        """Let the coming plan take its place if it begins at a time or has begun."""
        if self.coming and stamp_ns >= self.coming.begin_ns:
            self.plan, self.coming = self.coming, None

    def miss(self, number: int, begin_ns: int, stamp_ns: int) -> None:
        """Count a plan that has not come as late, once, if it was to begin before a time."""
        if stamp_ns > begin_ns and number > self._missed:
            self._missed = number
            self.late += 1
