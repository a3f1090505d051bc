"""The dissertation's evaluation (section 4.3), reproduced: workloads, simulation, metrics, tables."""
