"""Progress report of a playback, as text."""

from sms_handover.bag.time_order import TimeSpan
from sms_handover.playback.schedule import PlaybackSchedule
from sms_handover.units import ns_to_seconds

_PROMPT_NS = 100_000_000  # [ns] of wall time that a message may be late without a report
_SETTLED_NS = 500_000_000  # [ns] of wall time before the achieved rate is meaningful


def progress_line(schedule: PlaybackSchedule, span: TimeSpan, now_ns: int) -> str:
    """Return position, rate and number of messages sent."""
    position_s = ns_to_seconds(schedule.position_ns(now_ns) - int(span.start_ns))
    length_s = ns_to_seconds(int(span.end_ns) - int(span.start_ns))
    if schedule.clock.paused:
        state = "paused"
    elif schedule.clock.ran_ns(now_ns) < _SETTLED_NS:
        state = "playing"
    else:
        state = f"achieved {schedule.achieved_rate(now_ns):.2f}"
    return (
        f"{position_s:8.2f} of {length_s:g} s  rate {schedule.clock.rate:.2f}, {state}  "
        f"{schedule.sent_count} messages"
    )


def closing_line(schedule: PlaybackSchedule, now_ns: int) -> str:
    """Return the number of messages sent and the largest lag, with the achieved rate if it was late."""
    text = f"{schedule.sent_count} messages sent in {ns_to_seconds(schedule.clock.ran_ns(now_ns)):.2f} s"
    lag_ns = schedule.largest_lag_ns
    if lag_ns <= _PROMPT_NS:
        return f"{text}, none later than {ns_to_seconds(lag_ns) * 1000:.0f} ms"
    return (
        f"{text}, up to {ns_to_seconds(lag_ns):.2f} s late: achieved rate "
        f"{schedule.achieved_rate(now_ns):.2f} of {schedule.clock.rate:g}; none was dropped"
    )
