"""The faults in GHDL 2's synthesis that GHDL 3.0 corrects, and whether the installed GHDL has them.

* A constant of 64, 96, ... bits becomes zero if only its highest 32 bits are not zero (`lost_constants.py`).
* A constant for a whole signal is split from the wrong end if another branch assigns parts of the signal
  (`corrections.doubts`).
* An assignment to some bits of a signal is lost, or GHDL crashes, if a table grows during it (`padding.py`).

All other corrected faults are in each tested version: 2.0.0, 3.0.0, 4.1.0, 5.0.1 and 6.0.0.
"""

from __future__ import annotations

import re
import subprocess
from functools import cache


def has_faults(version: str) -> bool:
    """Return whether the GHDL that prints this version has the faults; an unknown version may have them."""
    found = re.match(r"GHDL (\d+)\.", version)
    return not found or int(found[1]) < 3


@cache
def is_at_hand() -> bool:
    """Return whether the installed GHDL has the faults."""
    return has_faults(subprocess.run(["ghdl", "--version"], capture_output=True, text=True, check=False).stdout)
