"""A SoC of LiteX with a wrapped system, as its builder writes it for Vivado.

    python -m tests.export.wrapper.litex_soc WRAPPER FOLDER [--without-keep]

The pads of the SoC have the names of the system's ports. Those of the registers lead to the SoC's bus, on which the
registers are. Without keep, the stream to the system has data alone.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from litex.build.generic_platform import Pins
from litex.build.xilinx import XilinxPlatform
from litex.gen import ClockDomain, LiteXModule
from litex.soc.integration.builder import Builder
from litex.soc.integration.soc_core import SoCMini
from litex.soc.interconnect import stream
from litex.soc.interconnect.axi import AXILiteInterface, AXIStreamInterface

from tests.export.wrapper.modules import load

ORIGIN = 0x4000_0000
"""The address of the registers."""


class Clock(LiteXModule):  # type: ignore[misc]
    """The clock and the reset of the pads."""

    def __init__(self, platform: Any) -> None:
        self.cd_sys = ClockDomain()
        self.comb += [self.cd_sys.clk.eq(platform.request("clk")), self.cd_sys.rst.eq(~platform.request("rst_n"))]


class Soc(SoCMini):  # type: ignore[misc]
    """The wrapped system, with its streams and the bus at pads."""

    def __init__(self, platform: Any, wrapper: Any, *, with_keep: bool) -> None:
        self.crg = Clock(platform)
        SoCMini.__init__(self, platform, 100_000_000, ident="", ident_version=False)
        self.system = wrapper(platform)
        sent, received = self.pads(self.system.sink, "s_axis"), self.pads(self.system.source, "m_axis")
        host = AXIStreamInterface(len(sent.tdata), user_width=1)
        self.comb += host.connect_to_pads(sent, "slave")
        if with_keep:
            self.comb += host.connect(self.system.sink)
        else:
            bare = stream.Endpoint([("data", len(sent.tdata))])
            self.comb += [host.connect(bare, omit={"keep", "id", "dest", "user"}), bare.connect(self.system.sink)]
        self.comb += self.system.source.connect_to_pads(received, "master")
        if hasattr(self.system, "s_axi"):
            self.system.add_s_axi_to_bus(self, ORIGIN)
            bus = AXILiteInterface(32, 32)
            self.comb += bus.connect_to_pads(self.pads(bus, "s_axi"), "slave")
            self.bus.add_master("host", bus)

    def pads(self, interface: Any, name: str) -> Any:
        """The pads for an interface."""
        self.platform.add_extension(interface.get_ios(name))
        return self.platform.request(name)


def main(wrapper: str, folder: str, *options: str) -> None:
    platform = XilinxPlatform("xc7a35t", [("clk", 0, Pins(1)), ("rst_n", 0, Pins(1))], toolchain="vivado")
    soc = Soc(platform, load(Path(wrapper)), with_keep="--without-keep" not in options)
    Builder(
        soc,
        output_dir=folder,
        compile_software=False,
        compile_gateware=False,
        csr_json=f"{folder}/soc.json",
    ).build(build_name="soc")


if __name__ == "__main__":
    main(*sys.argv[1:])
