"""Record of a campaign on disk: folder, manifest, journal, table."""
