"""The cache of generated cores, keyed by everything that determines their content."""
