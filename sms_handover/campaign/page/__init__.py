"""Page of a campaign: one self-contained HTML document."""
