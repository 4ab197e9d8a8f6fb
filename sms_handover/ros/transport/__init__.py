"""Transport: how messages reach the loop of a node, and how stamps are brought together."""
