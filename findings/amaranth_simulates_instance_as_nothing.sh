#!/bin/sh
# Guess:    Amaranth's simulator refuses a design with an `Instance` of Verilog or VHDL, since it cannot simulate it.
# Really:   the simulation runs without an error or a warning. The instance does not exist there: what it drives keeps
#           its initial value. So a test of the logic around it sees constants.
# Versions: Amaranth 0.5.10
# Source:   amaranth/sim/_pyrtl.py compiles the statements of fragments; an `Instance` has none
# Met by:   users who wrap existing VHDL or Verilog cores in Amaranth
# Instead:  elaborate a model in Python in place of the instance for simulations
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv env || { echo "needs the package python3-venv" >&2; exit 2; }
env/bin/pip --quiet install amaranth==0.5.10

cat > simulate.py <<'PYTHON'
import warnings
from importlib.metadata import version

from amaranth.hdl import Instance, Module, Signal
from amaranth.sim import Simulator

warnings.simplefilter("error")  # Any warning would be an error here.
module = Module()
a, y, doubled = Signal(8), Signal(8), Signal(8)
module.submodules.u_increment = Instance("increment", i_a=a, o_y=y)  # y = a + 1, in Verilog
module.d.comb += doubled.eq(2 * y)
seen = []


async def bench(context):
    for value in (3, 7):
        context.set(a, value)
        await context.delay(1e-9)
        seen.append(context.get(doubled))


simulator = Simulator(module)
simulator.add_testbench(bench)
simulator.run()
print("amaranth", version("amaranth"))
print("guess: an error that names the instance, or 2 * (a + 1) = [8, 16]")
print("seen:  no message, and", seen)
raise SystemExit(seen != [0, 0])
PYTHON
env/bin/python simulate.py
