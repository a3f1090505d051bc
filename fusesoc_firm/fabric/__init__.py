"""A node in fabric: what its hardware sends and compares, as plain values."""
