"""`make bench`: measure, print the tables, write docs/figures.md and the areas of Manager and schedulers.

    python -m tests.bench [PART ...] [--seed N] [--broken N]

Progress goes to the standard error, tables to the standard output. The exit code is 1 if a design cannot be measured,
a converter fails or a bar is missed; messages that are not converted yet are none of these.
"""

from __future__ import annotations

import argparse
import sys

from tests.bench import area, cycles, figures, fuzz, images, live, manager, simulators, systems, timing, use
from tests.bench.areas import write_areas
from tests.bench.nextpnr import Nextpnr
from tests.bench.tables import Table
from tests.bench.yosys import Yosys

SEED = 1


def main() -> int:
    """Measure what the arguments name."""
    parser = argparse.ArgumentParser(prog="tests.bench", description="Measure converters, Manager and schedulers.")
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{', '.join(figures.parts())}; all if none is named")
    parser.add_argument("--seed", type=int, default=SEED, help="of random payloads and faults (default: %(default)s)")
    parser.add_argument(
        "--broken", type=int, default=fuzz.BROKEN_FRAMES, help="broken frames for each converter (default: %(default)s)"
    )
    arguments = parser.parse_args()
    if unknown := set(arguments.parts) - set(figures.parts()):
        parser.error(f"no part {', '.join(sorted(unknown))}; there are {', '.join(figures.parts())}")
    sections = {}
    is_good = True
    for part in figures.parts():
        if arguments.parts and part not in arguments.parts:
            continue
        tables = _measure(part, arguments.seed, arguments.broken)
        is_good = is_good and all(table.is_good for table in tables)
        sections[part] = figures.section(part, tables)
        print(sections[part], flush=True)
        if part == "manager":
            write_areas(tables)
    figures.write(sections)
    return 0 if is_good else 1


def _measure(part: str, seed: int, broken: int) -> list[Table]:
    if part == "systems":
        return systems.measure(seed, _tell)
    if part == "live":
        return live.measure(_tell)
    yosys = Yosys()
    if part == "area":
        return area.measure(yosys, _tell)
    if part == "manager":
        return manager.measure(yosys, _tell)
    if part == "timing":
        return timing.measure(Nextpnr(yosys), _tell)
    if part == "use":
        return use.measure(seed, _tell)
    if part == "images":
        return images.measure(yosys, seed, _tell)
    if part == "simulators":
        return simulators.measure(_tell)
    return cycles.measure(seed, _tell) if part == "cycles" else fuzz.measure(seed, _tell, broken)


def _tell(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
