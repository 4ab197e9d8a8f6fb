"""Export of bags to tables, as CSV, Parquet or MATLAB files."""
