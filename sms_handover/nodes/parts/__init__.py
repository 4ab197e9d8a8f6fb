"""Parts of single nodes, each with one purpose."""
