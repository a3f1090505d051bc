"""`make proofs`: prove everything, see every broken copy fail, and write the table of docs/figures/proofs.md.

    python -m tools.proofs

The exit code is 1 if a property is not proved or a fault is not found.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path

from tools.proofs import document
from tools.proofs.all import PROOFS
from tools.proofs.proof import Proof


def main() -> int:
    """Prove one after the other, so that the seconds mean something."""
    argparse.ArgumentParser("tools.proofs", description="Prove everything, see every fault found.").parse_args()
    seconds = {proof.name: _seconds(proof) for proof in PROOFS}
    if None in seconds.values():
        return 1
    document.write({name: found for name, found in seconds.items() if found is not None})
    return 0


def _seconds(proof: Proof) -> float | None:
    """The seconds of a processor for all sizes, without the faults; None if something is not as it should be."""
    start = sum(os.times()[:4])
    is_good = True
    for size in (*proof.sizes, *proof.long_sizes):
        with tempfile.TemporaryDirectory() as name:
            outcome = proof.prove(size, Path(name))
        is_good = _tell(f"{proof.name}, {size}", "proved" if outcome.is_proved else "NOT PROVED") and is_good
    seconds = sum(os.times()[:4]) - start
    for mutation in proof.mutations:
        for label in mutation.violates:
            with tempfile.TemporaryDirectory() as name:
                found = proof.search(mutation, label, Path(name)).failed
            is_good = _tell(f"{proof.name}, broken", f"fails {label}" if found else f"MISSES {label}") and is_good
    return seconds if is_good else None


def _tell(what: str, verdict: str) -> bool:
    print(f"{what}: {verdict}", file=sys.stderr, flush=True)
    return not verdict[:2].isupper()


if __name__ == "__main__":
    sys.exit(main())
