"""Edalize's flow `gatemate`: a bitstream for FPGAs of the family Cologne Chip GateMate, by open tools.

Edalize finds a flow by its file's name, and its packages are namespace packages, so this one can be in another wheel.
"""

from __future__ import annotations

from fusesoc_firm.builds.step.open_flow import BitstreamFlow


class Gatemate(BitstreamFlow):
    """Synthesis by Yosys, layout by nextpnr, and the bitstream by the family's packer."""
