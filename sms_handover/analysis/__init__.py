"""What came of a run: metrics per phase and arm, the paper's claims, and tables that compare runs."""
