"""Arrays of times, short to write."""

from __future__ import annotations

import numpy as np

from fusesoc_firm.scheduling.evaluation.workloads import Times


def times(*rows: list[int]) -> Times:
    """A row for each set."""
    return np.array(rows, np.int64)
