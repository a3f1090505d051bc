#!/bin/sh
# Guess:    `fusesoc run` of a target with `cocotb_module` runs the tests of this module, or ends with an error.
# Really:   with cocotb 2.1, the simulator starts, prints that GPI_USERS is missing, runs no test and ends with 0. A
#           test that always fails does not fail the run, either; no results.xml is written.
# Versions: FuseSoC 2.4.7 with Edalize 0.6.8, cocotb 2.1.0, Icarus Verilog 11.0 and 12.0
# Source:   `configure` in edalize/flows/sim.py sets COCOTB_TEST_MODULES and PYGPI_PYTHON_BIN; cocotb 2.1 also needs
#           GPI_USERS, as share/lib/gpi/GpiCommon.cpp of cocotb shows
# Met by:   users of cocotb with FuseSoC whose CI looks at the exit status
# Instead:  GPI_USERS="$(cocotb-config --libpython);$(cocotb-config --pygpi-entry-point)", and check results.xml
set -eu
command -v iverilog > /dev/null || { echo "needs Icarus Verilog (the package iverilog)" >&2; exit 2; }
command -v make > /dev/null || { echo "needs the package make" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install fusesoc==2.4.7 edalize==0.6.8 cocotb==2.1.0
export HOME="$work"  # FuseSoC creates folders there.
PATH=$work/env/bin:$PATH
unset GPI_USERS
cocotb-config --libpython > /dev/null 2>&1 || { echo "needs Python as a library (libpython3-dev)" >&2; exit 2; }

printf 'module top(input a, output y);\n  assign y = a;\nendmodule\n' > top.v
cat > test_top.py <<'PYTHON'
import cocotb


@cocotb.test()
async def always_fails(dut):
    assert False
PYTHON
cat > top.core <<'CORE'
CAPI=2:
name: example:sim:top:1
filesets:
  rtl: {files: [top.v: {file_type: verilogSource}]}
  tests: {files: [test_top.py: {file_type: user, copyto: .}]}
targets:
  sim:
    filesets: [rtl, tests]
    toplevel: top
    flow: sim
    flow_options: {tool: icarus, cocotb_module: test_top}
CORE
touch fusesoc.conf
status=0
fusesoc --config fusesoc.conf --cores-root . run --target=sim example:sim:top > log 2>&1 || status=$?
pip list 2> /dev/null | grep -E '^(fusesoc|edalize|cocotb) '
iverilog -V 2> /dev/null | head -n 1
echo "guess: the test runs and fails, and the exit status is not 0"
echo "seen:  exit status $status, $(grep -c always_fails log || true) lines about the test, and this message:"
grep 'GPI_USERS' log
[ "$status" = 0 ]
if grep -q always_fails log; then exit 1; fi
[ -z "$(find build -name results.xml)" ]
