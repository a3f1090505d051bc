"""A component as a module of LiteX or Amaranth, around its Verilog netlist."""
