"""The task schedule and what it makes of it: phases, target poses, joint references."""
