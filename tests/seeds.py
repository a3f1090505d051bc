"""Seeds of random tests: the same in each run, but for the rounds of `make fuzz` (tools/fuzz.py)."""

from __future__ import annotations

import os
from random import Random

ROUND = "FIRM_FUZZ_SEED"
"""The variable with the seed of a round; what a round finds is repeated with it."""


def seeded(usual: int) -> int:
    """Return the seed of a test, below 2**31: `usual` or, in a round of `make fuzz`, another one for each round."""
    number = os.environ.get(ROUND)
    return Random(f"{number} {usual}").randrange(1, 1 << 31) if number else usual
