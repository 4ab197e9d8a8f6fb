"""What a run looks like: shapes and poses over time, for pictures and for a page that plays them."""
