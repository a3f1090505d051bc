// SPDX-License-Identifier: Apache-2.0
// firm_ddr_in and firm_ddr_out in cells of AMD's 7 series, in the modes that have both bits at the rising edge.

module firm_ddr_in (
  input  wire clk,
  input  wire pin,
  output wire first,
  output wire second
);

  IDDR #(.DDR_CLK_EDGE("SAME_EDGE_PIPELINED"))
    u_cell (.C(clk), .CE(1'b1), .R(1'b0), .S(1'b0), .D(pin), .Q1(first), .Q2(second));

endmodule

module firm_ddr_out (
  input  wire clk,
  input  wire first,
  input  wire second,
  output wire pin
);

  ODDR #(.DDR_CLK_EDGE("SAME_EDGE"))
    u_cell (.C(clk), .CE(1'b1), .R(1'b0), .S(1'b0), .D1(first), .D2(second), .Q(pin));

endmodule
