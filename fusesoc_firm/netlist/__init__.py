"""VHDL to Verilog: a netlist from GHDL, corrected and checked, for the Edalize tool `ghdlsynth`."""
