"""Definition of a campaign: its file, the distributions of its draws, its measure of success."""
