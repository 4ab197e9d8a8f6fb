"""What every node of the graph is made of: lifecycle, endpoints, filtered messages, events."""
