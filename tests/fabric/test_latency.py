"""How long a sample takes between the pins of a PHY and the system, in the generated node of a system, by GHDL."""

from __future__ import annotations

import re
from dataclasses import dataclass
from ipaddress import IPv4Address
from pathlib import Path

import pytest

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.node import Endpoint, Node, node_of
from fusesoc_firm.fabric.packets import Field, programs_of
from fusesoc_firm.message.library import libraries
from fusesoc_firm.system.derived.derivation import derive
from fusesoc_firm.system.derived.model import Network
from fusesoc_firm.system.written.specification import Draft, read_specification
from fusesoc_firm.text.diagnostics import Diagnostics
from tests.cores.ethernet import on_line
from tests.cores.test_net_link import NODE
from tests.fabric.programs import Fields, run
from tests.fabric.test_generated_node import SPECIFICATION, hardware
from tests.hdl.ghdl import REPOSITORY, Library, core_files

HERE = Path(__file__).parent
QUATERNION = rtps.XCDR1 + bytes(32)
# Cycles, from the last byte of the line to the Manager's first beat, and from its last beat to the line.
MOST_IN = MOST_OUT = 16
_PAGE = REPOSITORY / "docs" / "reference" / "ethernet.md"


@dataclass(frozen=True)
class _Fields(Fields):
    """Those of packets to the board."""

    node: Node

    def content(self) -> dict[Field, bytes]:
        network = self.node.network
        return {**super().content(), Field.MAC: network.mac, Field.ADDRESS: network.address.packed}


def _node() -> Node:
    faults, known = Diagnostics(), libraries((), None, None)
    system = derive(read_specification(Draft(Path("turtle.yaml"), SPECIFICATION), "", faults), Path(), known, faults)
    return node_of(system, known)


def _frames(node: Node) -> list[bytes]:
    """A peer announces itself, a writer and a reader for the topics of the node, and sends a sample."""
    network = Network(bytes([2, 0, 0, 0, 0, 1]), IPv4Address("192.0.2.1"), IPv4Address(0), None, "peer", "/", 0)
    graph, read, written = node.endpoints
    peer = Node(
        network,
        (
            graph,
            Endpoint(written.topic, written.type, written.hash, bytes([0, 0, 2, rtps.USER_READER]), written.quality),
            Endpoint(read.topic, read.type, read.hash, bytes([0, 0, 3, rtps.USER_WRITER]), read.quality),
        ),
        node.gid_bytes,
    )
    fields = _Fields(node.prefix, read.entity, peer.writers[1].entity, 1, 1, 1, 1, 1, 1, 1, 1, 1, node)
    programs = programs_of(peer)
    announced = ["announce_to_group", "writer_1", "writer_2", "reader_1"]
    return [*(run(programs, name, fields) for name in announced), run(programs, "sample", fields, QUATERNION)]


@pytest.mark.one_in(2)
@pytest.mark.parametrize("phase", [1, 7])
def test_a_sample_comes_and_leaves_in_time(tmp_path: Path, phase: int) -> None:
    """The page tells both figures, which do not depend on the phase of the PHY's clock by more than a cycle."""
    library = Library("firm", tmp_path)
    library.analyse(
        [*core_files(*NODE, "cdc/sync", "cdc/cdc", "net/mii"), *hardware(tmp_path, "125 MHz"), HERE / "latency.vhd"]
    )
    rows = [(len(line), *line) for line in map(on_line, _frames(_node()))]
    (tmp_path / "frames.txt").write_text("".join(f"{' '.join(map(str, row))}\n" for row in rows), encoding="ascii")
    generics = {"FRAME_BYTES": 5 + len(QUATERNION), "PHASE": phase}
    result = library.run("latency", generics, directory=tmp_path, seconds=600)
    assert result.exit_code == 0, result.output
    found = dict(row.split() for row in (tmp_path / "latency.txt").read_text(encoding="ascii").splitlines())
    print(found)
    assert int(found["in"]) <= MOST_IN
    assert int(found["out"]) <= MOST_OUT
    told = re.findall(r"\| (\d+) cycles \|", _PAGE.read_text(encoding="utf-8"))
    assert len(told) == 2
    assert int(told[0]) - 1 <= int(found["in"]) <= int(told[0])
    assert found["out"] == told[1]
