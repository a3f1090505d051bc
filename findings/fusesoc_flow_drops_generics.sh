#!/bin/sh
# Guess:    a target with `flow: sim` and `tool: ghdl` passes a parameter with `paramtype: generic` to GHDL, as the
#           same target with `default_tool: ghdl` does, whose deprecation message recommends the flow.
# Really:   the flow passes no generic. FuseSoC prints a warning and ends with 0; the top level keeps its default.
# Versions: FuseSoC 2.4.7 with Edalize 0.6.8, GHDL 2.0.0 and 5.0.1
# Source:   `argtypes` in edalize/flows/sim.py, which lacks `generic`; that of edalize/ghdl.py contains it
# Met by:   authors of VHDL cores who move a target from the tool API to the flow API
# Instead:  pass the generic in `run_options: [-gN=5]`
set -eu
command -v ghdl > /dev/null || { echo "needs GHDL (the package ghdl-mcode)" >&2; exit 2; }
command -v make > /dev/null || { echo "needs the package make" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install fusesoc==2.4.7 edalize==0.6.8
export HOME="$work"  # FuseSoC creates folders there.

cat > counter.vhd <<'VHDL'
entity counter is
  generic (N : natural := 3);
end entity counter;

architecture sim of counter is
begin
  assert false report "N is " & natural'image(N) severity note;
end architecture sim;
VHDL
cat > counter.core <<'CORE'
CAPI=2:
name: example:sim:counter:1
filesets:
  rtl: {files: [counter.vhd], file_type: vhdlSource-93}
parameters:
  N: {datatype: int, paramtype: generic}
targets:
  by_tool: {filesets: [rtl], toplevel: counter, parameters: [N=5], default_tool: ghdl}
  by_flow: {filesets: [rtl], toplevel: counter, parameters: [N=5], flow: sim, flow_options: {tool: ghdl}}
CORE
touch fusesoc.conf
for target in by_tool by_flow; do
  env/bin/fusesoc --config fusesoc.conf --cores-root . run --target="$target" example:sim:counter > log 2>&1 \
    || { cat log; exit 1; }
  eval "$target='$(grep -o 'N is [0-9]*' log)'"
done
env/bin/pip list 2> /dev/null | grep -E '^(fusesoc|edalize) '
ghdl --version | head -n 1
echo "guess: N is 5 in both targets"
echo "seen:  default_tool: $by_tool; flow: $by_flow, and FuseSoC ended with 0 after"
grep WARNING log
[ "$by_tool" = "N is 5" ] && [ "$by_flow" = "N is 3" ]
