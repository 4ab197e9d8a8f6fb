"""A recorded run as arrays: ticks, series and events."""
