"""Exchanges for tests: networks with flows, their VHDL, and a bench with random frames."""

from __future__ import annotations

from pathlib import Path

from fusesoc_firm.noc.hardware import TEMPLATE, exchange_configuration
from fusesoc_firm.noc.network import Flow, Network, Topology
from fusesoc_firm.text.render import render
from tests.hdl.ghdl import Library, core_files

ENTITY = "exchange"
BENCH = "exchange_bench"

_HERE = Path(__file__).parent


def all_to_all(endpoints: int) -> tuple[Flow, ...]:
    """Return a flow from each endpoint to each other one."""
    numbers = range(endpoints)
    return tuple(Flow(source, (sink,)) for source in numbers for sink in numbers if source != sink)


def network(topology: Topology, flows: tuple[Flow, ...], endpoints: int | None = None) -> Network:
    """Return a network with the endpoints in the first slots of a topology."""
    return Network(topology, topology.slots[:endpoints], flows)


def write_exchange(network: Network, width: int, folder: Path, *, buffers: int = 2) -> Path:
    """Write the VHDL of an exchange."""
    file = folder / f"{ENTITY}.vhd"
    file.write_text(render(TEMPLATE, exchange_configuration(ENTITY, network, width, buffers=buffers)), encoding="ascii")
    return file


def analysed(network: Network, width: int, folder: Path, *, buffers: int = 2) -> Library:
    """Return the library with an exchange and its bench."""
    Library("firm", folder).analyse(core_files("axis/package", "noc/noc", "sim/checker", "sim/host"))
    work = Library("work", folder)
    work.analyse([write_exchange(network, width, folder, buffers=buffers)])
    analyse_bench(network, width, folder)
    return work


def analyse_bench(network: Network, width: int, folder: Path) -> None:
    """Analyse the bench of an exchange, which must be analysed again after the exchange."""
    file = folder / f"{BENCH}.vhd"
    file.write_text(render(f"{BENCH}.vhd", bench_configuration(network, width), _HERE), encoding="ascii")
    Library("work", folder).analyse([file])


def bench_configuration(network: Network, width: int) -> dict[str, object]:
    """Return the data of the templates of benches."""
    by_source = [network.flows_of(source) for source in range(network.endpoints)]
    flows = [flow for flows in by_source for flow in flows]
    firsts = [sum(map(len, by_source[:source])) for source in range(network.endpoints + 1)]
    return {
        "library": "work",
        "entity": ENTITY,
        "endpoints": network.endpoints,
        "width": width,
        "has_tdest": network.destinations > 1,
        "tdest_bits": max(1, (network.destinations - 1).bit_length()),
        "flow_count": len(flows),
        "firsts": firsts,
        "flows": [
            {"place": place, "source": flow.source, "sinks": _set(flow.sinks, network.endpoints)}
            for place, flow in enumerate(flows)
        ],
    }


def _set(sinks: tuple[int, ...], endpoints: int) -> str:
    return "".join(str(int(sink in sinks)) for sink in reversed(range(endpoints)))
