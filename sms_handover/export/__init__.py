"""Tables out of bags, as CSV or Parquet: a run as rows per tick, any other bag as rows per message."""
