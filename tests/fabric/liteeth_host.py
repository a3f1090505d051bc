"""A host of LiteEth behind a GMII, as Verilog on the standard output: MAC, ARP, IPv4, and two ports of UDP.

    python liteeth_host.py > liteeth_host.v

Its address is 192.0.2.3, 02:00:00:00:00:03; its ports are those of RTPS in domain 0. It sends the payloads at `sink_*`;
the payloads that come to a port are at `discovery_*` and `user_*`.
"""

from __future__ import annotations

from liteeth.core import LiteEthUDPIPCore
from liteeth.phy.gmii import LiteEthPHYGMII
from litex.gen import ClockDomain, LiteXModule, Record, Signal
from litex.gen.fhdl.verilog import convert

PORTS = {"discovery": 7410, "user": 7411}
_PADS = [("rx_dv", 1), ("rx_er", 1), ("rx_data", 8), ("tx_en", 1), ("tx_er", 1), ("tx_data", 8)]
_SINK = ("valid", "ready", "last", "last_be", "data", "src_port", "dst_port", "ip_address", "length")
_SOURCE = ("valid", "last", "data", "src_port", "ip_address", "length")


class Host(LiteXModule):  # type: ignore[misc]
    """The core with one clock, which is the GMII's as well."""

    def __init__(self) -> None:
        self.cd_sys = ClockDomain("sys")
        pads = Record(_PADS, name="gmii")
        self.phy = LiteEthPHYGMII(None, pads, with_hw_init_reset=False, model=True)
        self.core = LiteEthUDPIPCore(
            self.phy, mac_address=0x020000000003, ip_address="192.0.2.3", clk_freq=125_000_000, dw=8
        )
        self.ports = {*pads.flatten(), self.cd_sys.clk, self.cd_sys.rst}
        for name, number in PORTS.items():
            port = self.core.udp.crossbar.get_port(number, dw=8)
            self.comb += port.source.ready.eq(1)
            for field in _SOURCE:
                self._export(f"{name}_{field}", getattr(port.source, field), is_input=False)
            if name == "discovery":
                for field in _SINK:
                    self._export(f"sink_{field}", getattr(port.sink, field), is_input=field != "ready")

    def _export(self, name: str, inner: Signal, *, is_input: bool) -> None:
        outer = Signal(len(inner), name=name)
        self.comb += inner.eq(outer) if is_input else outer.eq(inner)
        self.ports.add(outer)


if __name__ == "__main__":
    host = Host()
    print(convert(host, host.ports, name="liteeth_host"))
