// SPDX-License-Identifier: Apache-2.0
// firm_ddr_in and firm_ddr_out in cells of the ECP5, whose first bit belongs to the rising edge.

module firm_ddr_in (
  input  wire clk,
  input  wire pin,
  output wire first,
  output wire second
);

  IDDRX1F u_cell (.SCLK(clk), .RST(1'b0), .D(pin), .Q0(first), .Q1(second));

endmodule

module firm_ddr_out (
  input  wire clk,
  input  wire first,
  input  wire second,
  output wire pin
);

  ODDRX1F u_cell (.SCLK(clk), .RST(1'b0), .D0(first), .D1(second), .Q(pin));

endmodule
