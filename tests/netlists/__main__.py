"""`make fuzz-netlist`: random designs, their netlists held against GHDL's simulation; see docs/simulation.md."""

from __future__ import annotations

import argparse
import sys
import time
from random import SystemRandom

from tests.netlists.comparison import designs, differences
from tests.netlists.simulators import JUDGES


def main() -> int:
    """The exit status is 1 if a netlist is wrong or a program refuses a design."""
    parser = argparse.ArgumentParser(prog="make fuzz-netlist", description=__doc__)
    parser.add_argument("--seed", type=int, help="repeats a run (default: a new one, which is printed)")
    parser.add_argument("--designs", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0, help="number of the first design, to go on with a run")
    parser.add_argument("--batch", type=int, default=200, help="designs in one netlist")
    parser.add_argument("--judges", nargs="+", choices=list(JUDGES), default=list(JUDGES))
    options = parser.parse_args()
    seed = SystemRandom().randrange(1 << 31) if options.seed is None else options.seed
    print(
        f"seed {seed}, {options.designs} designs in GHDL and, as netlists, in {', '.join(options.judges)}", flush=True
    )
    begin, wrong = time.monotonic(), 0
    last = options.first + options.designs
    for first in range(options.first, last, options.batch):
        number = min(options.batch, last - first)
        for item in differences(designs(seed, first, number), options.judges):
            wrong += 1
            print(f"\n{item}", flush=True)
        done = first + number - options.first
        print(f"{done} designs, {wrong} differences, {time.monotonic() - begin:.0f} s", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
