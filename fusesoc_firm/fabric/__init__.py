"""A node in fabric: the data that its hardware sends and compares, as plain values."""
