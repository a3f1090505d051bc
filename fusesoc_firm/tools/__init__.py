"""External programs, Python packages and worker processes."""
