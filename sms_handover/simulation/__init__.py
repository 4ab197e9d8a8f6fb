"""The whole loop in one process: what the graph does, by plain calls."""
