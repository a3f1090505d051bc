"""Many random frames in the netlists of exchanges, simulated by Verilator."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from fusesoc_firm.noc.network import Network, chain, crossbar, mesh, tree
from fusesoc_firm.text.render import render
from tests.hdl.ghdl import Library, core_files
from tests.hdl.verilator import compiled
from tests.noc.exchanges import ENTITY, all_to_all, bench_configuration, network, write_exchange
from tests.noc.test_exchange import NETWORKS
from tests.recall import ran_or_recalled
from tests.seeds import seeded

pytestmark = pytest.mark.skipif(not shutil.which("verilator"), reason="no verilator; make test installs it")

SEED = seeded(3_000_000)
_HERE = Path(__file__).parent
# Besides the networks of the other tests; all of them together receive 3,000,000 frames.
_LARGE = {
    "mesh 4 x 4": network(mesh(4, 4), all_to_all(16)),
    "concentrated mesh of 16": network(mesh(2, 2, each=4), all_to_all(16)),
    "tree of 16": network(tree(16), all_to_all(16)),
    "crossbar of 8": network(crossbar(8), all_to_all(8)),
    "chain of 8": network(chain(8), all_to_all(8)),
}
FRAMES = 20_000


def _program(made: Network, width: int, buffers: int, folder: Path) -> Path:
    Library("firm", folder).analyse(core_files("axis/package", "noc/noc"))
    work = Library("work", folder)
    work.analyse([write_exchange(made, width, folder, buffers=buffers)])
    bench = render("exchange.cpp", bench_configuration(made, width), _HERE)
    return compiled(work.synthesise(ENTITY, None, "verilog"), ENTITY, bench, folder)


def _run(program: Path, frames: int, seed: int, source_stall: int, sink_stall: int, shortest: int) -> int:
    """Return the frames that have arrived."""
    print(f"seed {seed}, stalls {source_stall} % and {sink_stall} %")
    words = [str(program), *map(str, (frames, seed, source_stall, sink_stall, shortest))]
    result = ran_or_recalled(words, program.parent)
    found = re.search(r"PASS (\d+) frames", result.output)
    assert result.exit_code == 0, result.output
    assert found, result.output
    print(found[0])
    return int(found[1])


@pytest.mark.check
def test_a_few_thousand_frames(tmp_path: Path) -> None:
    program = _program(NETWORKS["copies"], 64, 2, tmp_path)
    assert _run(program, 3000, SEED, 10, 20, 1) > 3000


@pytest.mark.thorough
@pytest.mark.parametrize("name", [*NETWORKS, *_LARGE])
@pytest.mark.parametrize("width", [8, 64, 256])
def test_three_million_frames(name: str, width: int, tmp_path: Path) -> None:
    """Of each network at each width; copies are counted as frames."""
    made = {**NETWORKS, **_LARGE}[name]
    for buffers in (2, 16):
        folder = tmp_path / str(buffers)
        folder.mkdir()
        program = _program(made, width, buffers, folder)
        for number, (source_stall, sink_stall) in enumerate([(0, 0), (20, 20)]):
            assert _run(program, FRAMES, SEED + number, source_stall, sink_stall, 1 if width > 8 else 2) >= FRAMES
