"""Scene of a run: shapes and poses over time, for figures and for the 3D page."""
