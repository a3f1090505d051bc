"""What is written of the derived system: the top level and its test benches as plain data."""
