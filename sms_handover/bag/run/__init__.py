"""A recorded run out of a bag: ticks, series and events as arrays."""
