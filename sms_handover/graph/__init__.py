"""The graph as data: what topics, services and events the nodes have."""
