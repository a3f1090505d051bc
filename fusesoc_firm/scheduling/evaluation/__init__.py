"""Section 4.3 of the dissertation again: workloads, simulation, metrics and tables."""
