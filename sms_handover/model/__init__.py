"""Model of the robot: its description, the Pinocchio model, and conserved quantities."""
