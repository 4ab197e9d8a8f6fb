"""Statistics of a campaign: intervals, paired tests, sensitivities."""
