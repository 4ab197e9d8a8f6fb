"""Units and their conversions; seconds become integer nanoseconds here alone."""

NS_PER_S = 1_000_000_000  # [ns/s]
DEG_PER_RAD = 57.29577951308232  # [deg/rad]
MM_PER_M = 1000.0  # [mm/m]


def seconds_to_ns(seconds: float) -> int:
    """Return the nearest whole number of nanoseconds to a time in seconds."""
    return round(seconds * NS_PER_S)


def ns_to_seconds(time_ns: int) -> float:
    """Return a time in seconds from integer nanoseconds."""
    return time_ns / NS_PER_S
