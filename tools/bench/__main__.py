"""`make bench`: measure, print the tables, write docs/figures and the areas of Manager and schedulers.

    python -m tools.bench [PART ...] [--seed N] [--broken N] [--row PATTERN] [--seeds N ...]

Progress goes to the standard error, tables to the standard output. The exit code is 1 if a design cannot be measured,
a converter fails or a bar is missed; messages that are not converted yet are none of these.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable

from tools.bench import (
    actions,
    applications,
    area,
    bitstreams,
    builds,
    codec,
    cycles,
    figures,
    fuzz,
    fuzz_systems,
    images,
    inner_topics,
    kernels,
    links,
    live,
    loops,
    manager,
    network,
    noc,
    passing,
    peers,
    replay,
    resize,
    simulators,
    store,
    studio,
    systems,
    timing,
    use,
    watching,
)
from tools.bench.areas import write_areas
from tools.bench.nextpnr import SEEDS, Nextpnr
from tools.bench.tables import Table
from tools.bench.yosys import Yosys

SEED = 1


def main() -> int:
    """Run the measurements that the arguments name."""
    parser = argparse.ArgumentParser(prog="tools.bench", description="Measure converters, Manager and schedulers.")
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{', '.join(figures.parts())}; all if none is named")
    parser.add_argument("--seed", type=int, default=SEED, help="of random payloads and faults (default: %(default)s)")
    parser.add_argument(
        "--broken", type=int, default=fuzz.BROKEN_FRAMES, help="broken frames for each converter (default: %(default)s)"
    )
    parser.add_argument(
        "--row",
        default="",
        metavar="PATTERN",
        help="for timing, network, noc, boards, kernels, fuzz, loops, builds, actions: only rows whose names match,"
        " such as 'Image.* 64 bits'; for live and studio: only tables",
    )
    parser.add_argument(
        "--seeds",
        type=int,
        nargs="+",
        default=SEEDS,
        metavar="N",
        help="for timing, network, noc, kernels and peers: of placements (default: 1 2 3)",
    )
    arguments = parser.parse_args()
    if unknown := set(arguments.parts) - set(figures.parts()):
        parser.error(f"no part {', '.join(sorted(unknown))}; there are {', '.join(figures.parts())}")
    # Users' Python keeps compiled modules, so that of the measured programs does.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    sections = {}
    is_good = True
    for part in figures.parts():
        if arguments.parts and part not in arguments.parts:
            continue
        if part == "peers" and not peers.folders():
            _tell(peers.WITHOUT_FOLDERS)
            continue
        tables = _measure(part, arguments)
        is_good = is_good and all(table.is_good for table in tables)
        sections[part] = figures.section(part, tables)
        print(sections[part], flush=True)
        if part == "manager":
            write_areas(tables)
    figures.write(sections)
    return 0 if is_good else 1


def _measure(part: str, arguments: argparse.Namespace) -> list[Table]:
    seed = arguments.seed
    measures: dict[str, Callable[[], list[Table]]] = {
        "area": lambda: area.measure(Yosys(), _tell),
        "manager": lambda: manager.measure(Yosys(), _tell),
        "timing": lambda: timing.measure(Nextpnr(Yosys()), _tell, figures.written(), arguments.row, arguments.seeds),
        "network": lambda: network.measure(
            Nextpnr(Yosys(), device=network.DEVICE), _tell, figures.written(), arguments.row, arguments.seeds
        ),
        "boards": lambda: bitstreams.measure(_tell, figures.written(), arguments.row),
        "noc": lambda: noc.measure(Nextpnr(Yosys()), _tell, figures.written(), arguments.row, arguments.seeds),
        "kernels": lambda: kernels.measure(Nextpnr(Yosys()), _tell, figures.written(), arguments.row, arguments.seeds),
        "peers": lambda: peers.measure(Nextpnr(Yosys()), _tell, arguments.seeds),
        "loops": lambda: loops.measure(seed, _tell, figures.written(), arguments.row),
        "use": lambda: use.measure(seed, _tell),
        "passing": lambda: passing.measure(_tell),
        "inner_topics": lambda: inner_topics.measure(_tell),
        "cycles": lambda: cycles.measure(seed, _tell),
        "fuzz": lambda: _fuzz(arguments),
        "images": lambda: images.measure(Yosys(), seed, _tell),
        "links": lambda: links.measure(Yosys(), _tell),
        "applications": lambda: applications.measure(Yosys(), _tell),
        "systems": lambda: systems.measure(seed, _tell),
        "builds": lambda: builds.measure(_tell, figures.written(), arguments.row),
        "actions": lambda: actions.measure(_tell, figures.written(), arguments.row),
        "simulators": lambda: simulators.measure(_tell),
        "replay": lambda: replay.measure(seed, _tell),
        "live": lambda: live.measure(_tell, figures.written(), arguments.row),
        "resize": lambda: resize.measure(seed, _tell),
        "store": lambda: store.measure(_tell),
        "codec": lambda: codec.measure(_tell),
        "studio": lambda: _studio(arguments),
    }
    return measures[part]()


def _fuzz(arguments: argparse.Namespace) -> list[Table]:
    """The tables of converters and of whole systems, which together get ten times a converter's broken frames."""
    seed, broken, written, row = arguments.seed, arguments.broken, figures.written(), arguments.row
    return [
        *fuzz.measure(seed, _tell, broken, written, row),
        *fuzz_systems.measure(seed, _tell, 10 * broken, written, row),
    ]


def _studio(arguments: argparse.Namespace) -> list[Table]:
    """The tables of the page, of which the one that a pattern does not find is that of the written page."""
    written, row = figures.written(), arguments.row
    return [*studio.measure(arguments.seed, _tell, written, row), *watching.measure(_tell, written, row)]


def _tell(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
