"""The terminal: progress of long work, and keys."""
