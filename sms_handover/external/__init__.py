"""What a node of somebody else's imports to take the place of one of ours."""
