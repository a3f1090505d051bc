"""A design of Amaranth with a wrapped system, as Verilog on the standard output.

    python -m tests.export.wrapper.amaranth_design WRAPPER [--without-keep]

The ports of the design have the names of the system's ports. Without keep, nothing drives that of the stream to the
system.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from amaranth.back import verilog
from amaranth.hdl import ClockDomain, ClockSignal, Elaboratable, Module, ResetSignal, Signal
from amaranth.lib.wiring import In

from tests.export.wrapper.modules import load


class Design(Elaboratable):  # type: ignore[misc]
    """The wrapped system between ports."""

    def __init__(self, system: Any, *, with_keep: bool) -> None:
        self.system, self.with_keep = system, with_keep
        self.ports: dict[str, tuple[Signal, None]] = {}
        self.clk, self.rst_n = self.port("clk"), self.port("rst_n")

    def port(self, name: str, width: int = 1) -> Signal:
        """A port, whose direction follows from its use."""
        signal = Signal(width, name=name)
        self.ports[name] = signal, None
        return signal

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        m.domains.sync = ClockDomain()
        m.submodules.system = self.system
        m.d.comb += [ClockSignal().eq(self.clk), ResetSignal().eq(~self.rst_n)]
        sink, source = self.system.sink, self.system.source
        for word in ("data", "last", "user", *["keep"] * self.with_keep):
            field = getattr(sink.payload, word)
            m.d.comb += field.eq(self.port(f"s_axis_t{word}", len(field)))
        if not self.with_keep:
            self.port("s_axis_tkeep", len(sink.payload.keep))
        for word in ("data", "last", "user", "keep", "id"):
            field = getattr(source.payload, word)
            m.d.comb += self.port(f"m_axis_t{word}", len(field)).eq(field)
        m.d.comb += [sink.valid.eq(self.port("s_axis_tvalid")), self.port("s_axis_tready").eq(sink.ready)]
        m.d.comb += [self.port("m_axis_tvalid").eq(source.valid), source.ready.eq(self.port("m_axis_tready"))]
        for word, member in self.system.s_axi.signature.members.items() if hasattr(self.system, "s_axi") else ():
            field = getattr(self.system.s_axi, word)
            # The wrapper has the side of the target.
            if member.flow == In:
                m.d.comb += field.eq(self.port(f"s_axi_{word}", len(field)))
            else:
                m.d.comb += self.port(f"s_axi_{word}", len(field)).eq(field)
        return m


def main(wrapper: str, *options: str) -> None:
    design = Design(load(Path(wrapper))(), with_keep="--without-keep" not in options)
    print(verilog.convert(design, name="soc", ports=design.ports, strip_internal_attrs=True))


if __name__ == "__main__":
    main(*sys.argv[1:])
