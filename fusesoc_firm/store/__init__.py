"""The cache of generated cores, keyed by everything that decides their content."""
