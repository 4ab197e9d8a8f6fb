"""External nodes: what a user's node imports to take the place of one of ours."""
