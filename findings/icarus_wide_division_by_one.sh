#!/bin/sh
# Guess:    an expression has the same value in a continuous assignment and in an initial block.
# Really:   with 65 bits, `b / d` with d = 1 is zero in a continuous assignment if bit 64 of b and lower bits are set.
#           The same division in an initial block is right; so are others whose quotient fits into 64 bits.
# Versions: Icarus Verilog 11.0 (Debian 12) and 12.0 (Debian 13)
# Source:   vvp/arith.cc is the place of `.arith/div`; no report is known to us
# Met by:   everyone who simulates wide arithmetic, such as the netlists of fixed-point designs or random tests of them
set -eu
command -v iverilog > /dev/null || { echo "needs Icarus Verilog, such as Debian 12: apt-get install iverilog=11.0-1.1+b1" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

cat > divide.v <<'VERILOG'
module divide;
  reg [64:0] b, d, inside;
  wire [64:0] assigned = b / d;

  task show(input [64:0] dividend, input [64:0] divisor);
    begin
      b = dividend;
      d = divisor;
      #1 inside = b / d;
      $display("%h / %0d: assigned %h inside %h", b, d, assigned, inside);
    end
  endtask

  initial begin
    show(65'h1_8000_0000_0000_0000, 1);
    show(65'h0_8000_0000_0000_0000, 1);
    show(65'h1_8000_0000_0000_0000, 2);
  end
endmodule
VERILOG
iverilog -o divide divide.v
vvp -n divide > seen
iverilog -V 2> /dev/null | head -n 1
echo "guess: both values are equal in each line"
echo "seen:"
cat seen
cat > expected <<'TEXT'
18000000000000000 / 1: assigned 00000000000000000 inside 18000000000000000
08000000000000000 / 1: assigned 08000000000000000 inside 08000000000000000
18000000000000000 / 2: assigned 0c000000000000000 inside 0c000000000000000
TEXT
cmp seen expected
