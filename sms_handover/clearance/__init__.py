"""Clearance: signed distances between the bodies of robot and deputy, and which of them may touch."""
