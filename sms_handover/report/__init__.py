"""A report of recorded runs: one HTML page that needs nothing but a browser."""
