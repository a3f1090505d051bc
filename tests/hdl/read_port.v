// SPDX-License-Identifier: Apache-2.0
// The read port of a memory for the search of loops: each of its bits depends on the whole address. Registers and
// multiplexers in place of the memory would tell the same, and take several times as long.
(* techmap_celltype = "$memrd" *)
module read_port (CLK, EN, ADDR, DATA);
  parameter MEMID = "";
  parameter ABITS = 8;
  parameter WIDTH = 8;
  parameter CLK_ENABLE = 0;
  parameter CLK_POLARITY = 0;
  parameter TRANSPARENT = 0;
  input CLK, EN;
  input [ABITS-1:0] ADDR;
  output [WIDTH-1:0] DATA;
  assign DATA = {WIDTH{^ADDR}};
endmodule
