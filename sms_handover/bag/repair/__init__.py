"""Check and repair of bags: what is missing or damaged in one, and a whole one of what can be read."""
