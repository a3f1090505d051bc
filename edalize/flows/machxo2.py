"""Edalize's flow `machxo2`: a bitstream for FPGAs of the family Lattice MachXO2, by open tools.

Edalize finds a flow by its file's name, and its packages are namespace packages, so this one can be in another wheel.
"""

from __future__ import annotations

from fusesoc_firm.builds.step.open_flow import BitstreamFlow


class Machxo2(BitstreamFlow):
    """Synthesis by Yosys, layout by nextpnr, and the bitstream by the family's packer."""
