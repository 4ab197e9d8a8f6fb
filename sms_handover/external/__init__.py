"""External nodes: what a node of another package imports to replace one of ours."""
