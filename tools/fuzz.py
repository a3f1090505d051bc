"""`make fuzz`: the random tests with new seeds, round by round, and random designs against their netlists.

    python -m tools.fuzz netlists bags --minutes 30
    python -m tools.fuzz --seed 7 --rounds 1 frames       # repeats a round

The seed of each round is printed. The exit code is 1 if something failed.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from random import SystemRandom

from tests.seeds import ROUND

# The tests of each campaign, below tests/.
CAMPAIGNS: Mapping[str, Sequence[str]] = {
    "netlists": (),
    "frames": ("converter", "system", "cores", "applications", "runs/verify"),
    "packets": ("fabric", "wiznet"),
    "messages": ("frame", "message", "middleware", "errors", "text"),
    "bags": ("storage", "runs/bags", "runs/replay"),
    "resets": ("system/simulated/test_random_resets.py", "system/simulated/test_several_clocks.py"),
}
# Campaigns of tests that take minutes each.
_LONG = ("resets",)
# Of random netlists in a round.
DESIGNS = 200


def main() -> int:
    """Run rounds of the campaigns by turns until the time is over."""
    parser = argparse.ArgumentParser(
        prog="make fuzz", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("campaigns", nargs="*", metavar="CAMPAIGN", help=f"of: {', '.join(CAMPAIGNS)} (default: all)")
    parser.add_argument("--minutes", type=float, default=60, help="no round begins later (default: 60)")
    parser.add_argument("--rounds", type=int, help="the number of rounds (default: by the time)")
    parser.add_argument("--seed", type=int, help="of the first round (default: a new one)")
    options = parser.parse_args()
    if unknown := [name for name in options.campaigns if name not in CAMPAIGNS]:
        parser.error(f"no campaign is called '{unknown[0]}'; legal: {', '.join(CAMPAIGNS)}")
    names = options.campaigns or list(CAMPAIGNS)
    seed = SystemRandom().randrange(1 << 30) if options.seed is None else options.seed
    end, number, failed = time.monotonic() + options.minutes * 60, 0, []
    while time.monotonic() < end and number != options.rounds:
        for name in names:
            print(f"\n{name}, seed {seed + number}", flush=True)
            if subprocess.run(_command(name, seed + number), env=_environment(seed + number), check=False).returncode:
                failed.append(f"{name} --seed {seed + number}")
        number += 1
    print(f"\n{number} rounds of {', '.join(names)}: {len(failed)} failed")
    for words in failed:
        print(f"  python -m tools.fuzz {words} --rounds 1")
    return 1 if failed else 0


def _command(campaign: str, seed: int) -> list[str]:
    if not (places := CAMPAIGNS[campaign]):
        return [sys.executable, "-m", "tools.fuzz_netlist", "--seed", str(seed), "--designs", str(DESIGNS)]
    tests = [f"tests/{place}" for place in places]
    marks = ["-m", "thorough"] if campaign in _LONG else []
    return [sys.executable, "-m", "pytest", "-q", "-n", "auto", "--dist", "loadgroup", *marks, *tests]


def _environment(seed: int) -> Mapping[str, str]:
    return {**os.environ, ROUND: str(seed)}


if __name__ == "__main__":
    sys.exit(main())
