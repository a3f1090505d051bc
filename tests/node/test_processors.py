"""The node in C++ before the model of AXI DMA, also compiled for the processors of boards and run by QEMU.

The node has no ROS here: its engine, the driver and Linux's devices are the code of the generated node.
"""

from __future__ import annotations

import shutil
from contextlib import closing
from pathlib import Path

import pytest

from fusesoc_firm.node.transport.simulator import SimulatorTransport
from tests.cores.pipes import pipe_bench
from tests.node.dma_engine import ERRORS, MM2S, S2MM, Fault, Simulated, board
from tests.node.drivers import Driver, cpp_driver, cross_compiled_driver
from tests.seeds import seeded

SEED = seeded(20261125)
MEMORY_BYTES = 1 << 24
PROCESSORS = {"arm": "arm-linux-gnueabihf", "aarch64": "aarch64-linux-gnu"}
NAMES = ["DMAIntErr", "DMASlvErr", "DMADecErr", "SGIntErr", "SGSlvErr", "SGDecErr"]


@pytest.fixture(scope="module", params=["here", *(pytest.param(name, marks=pytest.mark.check) for name in PROCESSORS)])
def driver(request: pytest.FixtureRequest) -> Driver:
    processor: str = request.param
    if processor == "here":
        return cpp_driver("processor")
    triple = PROCESSORS[processor]
    for program in (f"{triple}-g++", f"qemu-{processor}"):
        if not shutil.which(program):
            pytest.skip(f"{program} is not installed")
    return cross_compiled_driver("processor", processor, triple)


def _play(driver: Driver, root: Path, count: int, longest: int, restarts: int) -> tuple[list[str], dict[str, int]]:
    """What the node tells, and the counts at its end."""
    print(f"seed {SEED}")
    *told, counts = driver.answers([], str(root), *map(str, [count, longest, SEED, restarts]))
    words = counts.split()
    return told, dict(zip(words[::2], map(int, words[1::2]), strict=True))


@pytest.mark.check
def test_messages_of_all_sizes_come_back(driver: Driver, tmp_path: Path) -> None:
    with board(tmp_path, MEMORY_BYTES):
        told, counts = _play(driver, tmp_path, 200, 4 << 20, 0)
    assert not told
    assert counts == {"sent": 200, "published": 200, "lost": 0, "silently": 0}


@pytest.mark.check
def test_every_fault_is_told(driver: Driver, tmp_path: Path) -> None:
    """Every error bit in both directions, a channel that halts, a reset by somebody else: no loss in silence."""
    bits = [(channel, bit, name) for channel in (MM2S, S2MM) for bit, name in zip(ERRORS, NAMES, strict=True)]
    faults = [Fault(20 * (number + 1), channel, bit) for number, (channel, bit, _) in enumerate(bits)]
    faults += [Fault(300, MM2S, is_reset=True), Fault(350, S2MM, is_reset=True), Fault(400, S2MM, is_silent=True)]
    with board(tmp_path, MEMORY_BYTES, faults=faults) as engine:
        told, counts = _play(driver, tmp_path, 1000, 4 << 20, len(faults))
        assert not engine.faults
    assert len(told) == len(faults)
    for channel, _, name in bits:
        where = "MM2S" if channel == MM2S else "S2MM"
        assert any(f"{where}: {name} " in line for line in told)
    assert sum("the channel has halted" in line for line in told) == 3
    assert counts["published"] + counts["lost"] == 1000
    assert counts["lost"] > 0 and counts["silently"] == 0


def test_messages_pass_simulated_hardware(driver: Driver, tmp_path: Path) -> None:
    """GHDL simulates the system, which is a wire."""
    bench = pipe_bench("ghdl", tmp_path)
    with (
        closing(SimulatorTransport(lambda: bench.start(64, SEED=1, STALL_PERCENT=30))) as transport,
        board(tmp_path, MEMORY_BYTES, stream=Simulated(transport)),
    ):
        told, counts = _play(driver, tmp_path, 100, 4096, 0)
    assert not told
    assert counts == {"sent": 100, "published": 100, "lost": 0, "silently": 0}
