"""The faults of GHDL's synthesis that only some versions have: later versions are not searched for them.

A fault that is corrected and has no entry here is in all versions that were tried: 2.0.0, 3.0.0, 4.1.0, 5.0.1, 6.0.0.
"""

from __future__ import annotations

import re
import subprocess
from enum import Enum, auto
from functools import cache


class Fault(Enum):
    """A fault of some versions."""

    # A constant of 64, 96, ... bits becomes zero if only its highest 32 bits are not zero.
    LOST_CONSTANTS = auto()
    # A constant for a whole signal is taken apart from the wrong end if another branch assigns parts of the signal.
    MIXED_CONSTANTS = auto()
    # An assignment to some bits of a signal is lost, or GHDL crashes, if a table grows during the assignment.
    GROWN_TABLES = auto()


# The first version, major and minor, without the fault.
_MENDED = {Fault.LOST_CONSTANTS: (3, 0), Fault.MIXED_CONSTANTS: (5, 0), Fault.GROWN_TABLES: (3, 0)}


def faults_of(version: str) -> frozenset[Fault]:
    """Return the faults of the GHDL that prints this version; all of them if the version is unknown."""
    found = re.match(r"GHDL (\d+)\.(\d+)", version)
    return frozenset(fault for fault in Fault if not found or (int(found[1]), int(found[2])) < _MENDED[fault])


@cache
def faults_at_hand() -> frozenset[Fault]:
    """Return the faults of the installed GHDL."""
    return faults_of(subprocess.run(["ghdl", "--version"], capture_output=True, text=True, check=False).stdout)
