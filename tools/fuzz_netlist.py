"""`make fuzz-netlist`: random designs, their netlists held against GHDL's simulation; see docs/reference/netlist.md."""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from random import SystemRandom

from tests.netlist.comparison import DIFFERENCE, FAILURE, designs, differences
from tests.netlist.simulators import JUDGES

# All batches are judged by Icarus, and each twentieth by the others, which take ten times as long.
EVERY = {"icarus": 1, "yosys": 20, "verilator": 20}


def main() -> int:
    """The exit status is 1 if a netlist is wrong, or none for a simulator; what GHDL refuses is counted apart."""
    parser = argparse.ArgumentParser(prog="make fuzz-netlist", description=__doc__)
    parser.add_argument("--seed", type=int, help="repeats a run (default: a new one, which is printed)")
    parser.add_argument("--designs", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0, help="number of the first design, to go on with a run")
    parser.add_argument("--batch", type=int, default=40, help="designs in one netlist")
    parser.add_argument("--judges", nargs="+", choices=list(JUDGES), help="(default: Icarus, others in part)")
    options = parser.parse_args()
    seed = SystemRandom().randrange(1 << 31) if options.seed is None else options.seed
    every = dict.fromkeys(options.judges, 1) if options.judges else EVERY
    print(f"seed {seed}, {options.designs} designs in GHDL and as netlists", flush=True)
    compared, kinds = Counter[str](), Counter[str]()
    begin, last = time.monotonic(), options.first + options.designs
    for batch, first in enumerate(range(options.first, last, options.batch)):
        number = min(options.batch, last - first)
        judges = [judge for judge in every if batch % every[judge] == 0]
        found = differences(designs(seed, first, number), judges)
        kinds.update(item.kind for item in found)
        for item in found:
            print(f"\n{item}", flush=True)
        refused = sum(item.kind != DIFFERENCE for item in found)
        compared.update(dict.fromkeys(judges, number - refused))
        judged = ", ".join(f"{judge} {compared[judge]}" for judge in compared)
        refusals = ", ".join(f"{count} {kind}" for kind, count in kinds.items() if kind != DIFFERENCE) or "none refused"
        done, seconds = first + number - options.first, time.monotonic() - begin
        print(
            f"{done} designs ({judged}): {kinds[DIFFERENCE]} differences; {refusals}; "
            f"{seconds:.0f} s, {done / seconds:.1f} designs/s",
            flush=True,
        )
    return 1 if kinds[DIFFERENCE] or kinds[FAILURE] else 0


if __name__ == "__main__":
    sys.exit(main())
