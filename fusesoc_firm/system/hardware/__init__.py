"""The derived system as plain data for the templates of the top level and its test benches."""
