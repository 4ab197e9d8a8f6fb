"""The robot: its description, the Pinocchio model made from it, and the quantities it conserves."""
