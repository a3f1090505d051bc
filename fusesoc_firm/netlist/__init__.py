"""VHDL to Verilog: GHDL's netlist, put right where GHDL 2.0 writes it wrongly; what Edalize's tool `ghdlsynth` runs."""
