"""Accelerators as GHDL and Yosys read them, compared with the interface of the specification."""
