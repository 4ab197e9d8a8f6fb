"""The process of a node: start and end, its launcher, scheduling, network scope."""
