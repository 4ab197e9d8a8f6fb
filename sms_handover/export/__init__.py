"""Export of bags to tables, as CSV or Parquet."""
