"""MCAP files: records, chunks and summary, also of damaged files."""
