#!/bin/sh
# Guess:    each hook of a target runs once, in the order pre_build, post_build, pre_run, post_run.
# Really:   with the flow API, `fusesoc run` runs pre_build twice and post_run never, and ends with 0. The tool API
#           (`default_tool`) runs each hook once.
# Versions: FuseSoC 2.4.7 with Edalize 0.6.8, Icarus Verilog 11.0 and 12.0
# Source:   edalize/flows/edaflow.py: `run` builds the makefile's target `run`, and `post_run` depends on it, so
#           nothing asks for `post_run`; `pre_build` belongs to each command and has no file that make could compare
# Met by:   authors of cores whose post_run hook checks or stores the results of a simulation
set -eu
command -v iverilog > /dev/null || { echo "needs Icarus Verilog (the package iverilog)" >&2; exit 2; }
command -v make > /dev/null || { echo "needs the package make" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install fusesoc==2.4.7 edalize==0.6.8
export HOME="$work"  # FuseSoC creates folders there.

for hook in pre_build post_build pre_run post_run; do
  printf '#!/bin/sh\necho %s >> "%s/hooks"\n' "$hook" "$work" > "$hook.sh"
done
echo 'module top; initial $finish; endmodule' > top.v
cat > top.core <<'CORE'
CAPI=2:
name: example:sim:top:1
filesets:
  rtl: {files: [top.v: {file_type: verilogSource}]}
  hooks: {files: [pre_build.sh, post_build.sh, pre_run.sh, post_run.sh], file_type: user}
scripts:
  pre_build: {cmd: [sh, ../../../pre_build.sh]}
  post_build: {cmd: [sh, ../../../post_build.sh]}
  pre_run: {cmd: [sh, ../../../pre_run.sh]}
  post_run: {cmd: [sh, ../../../post_run.sh]}
targets:
  by_tool: &target
    filesets: [rtl]
    toplevel: top
    default_tool: icarus
    hooks: {pre_build: [pre_build], post_build: [post_build], pre_run: [pre_run], post_run: [post_run]}
  by_flow:
    <<: *target
    flow: sim
    flow_options: {tool: icarus}
CORE
touch fusesoc.conf
for target in by_tool by_flow; do
  rm -f hooks
  env/bin/fusesoc --config fusesoc.conf --cores-root . run --target="$target" example:sim:top > log 2>&1 \
    || { cat log; exit 1; }
  eval "$target='$(tr '\n' ' ' < hooks)'"
done
env/bin/pip list 2> /dev/null | grep -E '^(fusesoc|edalize) '
iverilog -V 2> /dev/null | head -n 1
echo "guess: pre_build post_build pre_run post_run"
echo "seen:  default_tool: $by_tool"
echo "       flow:         $by_flow"
[ "$by_tool" = "pre_build post_build pre_run post_run " ]
[ "$by_flow" = "pre_build post_build pre_build pre_run " ]
