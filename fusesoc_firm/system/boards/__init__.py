"""Boards: what an FPGA is connected to, and the top level that fits a system on it."""
