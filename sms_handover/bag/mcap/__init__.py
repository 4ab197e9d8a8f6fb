"""MCAP files: their records, chunks and summary, read also where they are damaged."""
