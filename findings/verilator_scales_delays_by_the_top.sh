#!/bin/sh
# Guess:    a delay counts in the time unit of its module (IEEE 1800-2017, 3.14.2), whatever the unit of the top is.
# Really:   Verilator with --timing counts it in the unit of the top: #9000 in a module of 1 ps below a top of 1 ns takes
#           9000 ns. Icarus Verilog waits for 9 ns.
# Versions: Verilator 5.006, Icarus Verilog 11.0 (Debian 12)
# Source:   no report is known to us
# Met by:   everyone who takes a clock generator or a bus model with a time unit of its own into a test bench
# Remedy:   give all modules with delays the time unit of the top
set -eu
for program in verilator iverilog g++ make; do
  command -v "$program" > /dev/null || { echo "needs $program, such as Debian 12: apt-get install verilator iverilog g++ make" >&2; exit 2; }
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

cat > top.v <<'VERILOG'
`timescale 1ns / 1ps
module top;
  wire done;
  part u_part (.done(done));
  always @(posedge done) begin
    $display("done after %0d ns", $time);
    $finish;
  end
endmodule
VERILOG
cat > part.v <<'VERILOG'
`timescale 1ps / 1ps
module part (output reg done);
  initial begin
    done = 0;
    #9000 done = 1;
  end
endmodule
VERILOG

verilator --version
iverilog -V 2> /dev/null | head -1
verilator --binary --timing --top-module top top.v part.v > verilator.log 2>&1
iverilog -o top.vvp top.v part.v
verilated=$(obj_dir/Vtop | grep done)
interpreted=$(vvp -n top.vvp | grep done)
echo "guess:     #9000 in a module of 1 ps takes 9 ns"
echo "Verilator: $verilated"
echo "Icarus:    $interpreted"
[ "$verilated" = "done after 9000 ns" ] && [ "$interpreted" = "done after 9 ns" ]
