"""Accelerators as GHDL, Yosys and `cpp` read them, compared with the interface of the specification."""
