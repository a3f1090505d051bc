"""`make fuzz-netlist`: random designs, their netlists held against GHDL's simulation; see docs/reference/netlist.md."""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from random import SystemRandom

from tests.netlist.comparison import designs, differences
from tests.netlist.simulators import JUDGES

# Every how many batches a simulator judges, and how many designs of it: Verilator takes a minute for ten.
SHARES = {"icarus": (1, None), "yosys": (10, None), "verilator": (10, 10)}


def main() -> int:
    """The exit status is 1 if a netlist is wrong or a program refuses a design."""
    parser = argparse.ArgumentParser(prog="make fuzz-netlist", description=__doc__)
    parser.add_argument("--seed", type=int, help="repeats a run (default: a new one, which is printed)")
    parser.add_argument("--designs", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0, help="number of the first design, to go on with a run")
    parser.add_argument("--batch", type=int, default=100, help="designs in one netlist")
    parser.add_argument("--judges", nargs="+", choices=list(JUDGES), help="(default: Icarus, others in part)")
    options = parser.parse_args()
    seed = SystemRandom().randrange(1 << 31) if options.seed is None else options.seed
    print(f"seed {seed}, {options.designs} designs in GHDL and as netlists", flush=True)
    compared, kinds = Counter[str](), Counter[str]()
    begin, last = time.monotonic(), options.first + options.designs
    for batch, first in enumerate(range(options.first, last, options.batch)):
        number = min(options.batch, last - first)
        batched = designs(seed, first, number)
        shares = dict.fromkeys(options.judges, (1, None)) if options.judges else SHARES
        for judge, (every, most) in shares.items():
            if batch % every == 0:
                compared[judge] += len(batched[:most])
                for item in differences(batched[:most], [judge]):
                    kinds["differences" if item.judge in JUDGES else "refusals"] += 1
                    print(f"\n{item}", flush=True)
        judged = ", ".join(f"{judge} {compared[judge]}" for judge in compared)
        found = f"{kinds['differences']} differences, {kinds['refusals']} refusals"
        seconds = time.monotonic() - begin
        print(f"{first + number - options.first} designs ({judged}), {found}, {seconds:.0f} s", flush=True)
    return 1 if kinds.total() else 0


if __name__ == "__main__":
    sys.exit(main())
