"""AXI DMA in C++ before the model of the engine, and its device made of files."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.node.dma_engine import (
    DMA_DECODE,
    DMA_SLAVE,
    MM2S,
    REGISTER_BYTES,
    S2MM,
    SG_SLAVE,
    Built,
    Fault,
    board,
    board_files,
)
from tests.node.drivers import Driver, cpp_driver
from tests.seeds import seeded

SEED = seeded(20261123)
# Some frames are the record of an aborted frame.
RECORD_BYTES = 7
MEMORY_BYTES = 1 << 22


@pytest.fixture(scope="module")
def driver() -> Driver:
    return cpp_driver("dma")


def play(driver: Driver, root: Path, count: int, longest: int, buffer: int, seconds: int = 60) -> str:
    return driver.answers([], str(root), *map(str, [count, longest, buffer, SEED, seconds]))[0]


@pytest.mark.one_in(2)
@pytest.mark.parametrize(
    ("count", "longest", "buffer"), [(500, 300, 64), (500, 300, 1024), (20, 100_000, 4096), (50, 0, 0)]
)
def test_frames_go_there_and_back(driver: Driver, tmp_path: Path, count: int, longest: int, buffer: int) -> None:
    """Also those that are longer than a buffer, and than all of them."""
    print(f"seed {SEED}")
    with board(tmp_path, MEMORY_BYTES):
        word, size, _ = play(driver, tmp_path, count, longest, buffer).split()
    assert word == "ok" and count * 5 <= int(size) <= count * (longest + RECORD_BYTES)


@pytest.mark.parametrize(
    ("fault", "error"),
    [
        (Fault(10, MM2S, DMA_DECODE), "the DMA engine's MM2S: DMADecErr (address)"),
        (Fault(10, S2MM, DMA_SLAVE), "the DMA engine's S2MM: DMASlvErr (response from memory)"),
        (Fault(10, S2MM, is_silent=True), "the DMA engine's S2MM: the channel has halted"),
        (Fault(10, MM2S, is_stalled=True), "the transport is closed"),
        (Fault(10, S2MM, is_too_long=True), "the DMA engine wrote past the end of a buffer"),
        # The last frame: nobody sends any more.
        (Fault(100, MM2S, SG_SLAVE), "the DMA engine's MM2S: SGSlvErr (response from memory)"),
    ],
)
def test_errors_of_the_engine_are_named(driver: Driver, tmp_path: Path, fault: Fault, error: str) -> None:
    with board(tmp_path, MEMORY_BYTES, faults=[fault]):
        assert play(driver, tmp_path, 100, 100, 64, 1 if fault.is_stalled else 60) == f"error: {error}"


@pytest.mark.parametrize(
    ("built", "error"),
    [
        (
            Built(has_scatter_gather=False),
            "the DMA engine does not support scatter-gather, so it is not from a generated block design",
        ),
        (Built(reset_seconds=1e9), "the DMA engine does not leave reset; check the engine's clock"),
        (Built(starts=False), "the DMA engine does not start"),
    ],
)
def test_an_engine_that_does_not_start_is_named(driver: Driver, tmp_path: Path, built: Built, error: str) -> None:
    with board(tmp_path, MEMORY_BYTES, built=built):
        assert play(driver, tmp_path, 1, 1, 64) == f"error: {error}"


@pytest.mark.parametrize("size", [63, 100, 1 << 21])
def test_illegal_buffers_are_named(driver: Driver, tmp_path: Path, size: int) -> None:
    with board(tmp_path, MEMORY_BYTES):
        assert play(driver, tmp_path, 1, 1, size) == (
            f"error: the DMA has 4 buffers of {size} bytes; legal: 2 or more, a multiple of 64, and all within the"
            " 4194304 bytes of memory"
        )


def _device(root: Path, address: int = 0x3F000000, kind: str = "u-dma-buf") -> Path:
    """The files of UIO and u-dma-buf."""
    board_files(root, 8192, address, kind)
    registers = bytearray(REGISTER_BYTES)
    registers[0x34:0x38] = (77).to_bytes(4, "little")
    (root / "dev/uio0").write_bytes(registers)
    return root


@pytest.mark.parametrize("kind", ["u-dma-buf", "udmabuf"])
def test_a_device_of_files(driver: Driver, tmp_path: Path, kind: str) -> None:
    root = _device(tmp_path, kind=kind)
    assert driver.answers([], "files", str(root)) == [f"ok 77 8192 {0x3F000000}"]
    assert (root / "dev/uio0").read_bytes()[0x30:0x34] == (0x1234567).to_bytes(4, "little")
    assert (root / "dev/udmabuf0").read_bytes()[5] == 0xAB
    # Not cached, and not a device's memory either.
    assert (root / f"sys/class/{kind}/udmabuf0/sync_mode").read_text() == "2"


def test_a_device_that_does_not_serve_is_named(driver: Driver, tmp_path: Path) -> None:
    root = _device(tmp_path, 0xFFFFF000)
    far = driver.answers([], "files", str(root))
    assert far == ["error: udmabuf0 ends beyond the 4 GiB that the DMA engine reaches"]
    address = root / "sys/class/u-dma-buf/udmabuf0/phys_addr"
    address.write_text("0x1020\n")
    askew = driver.answers([], "files", str(root))
    assert askew == ["error: udmabuf0 begins at 4128, which is not a multiple of 64"]
    size = root / "sys/class/u-dma-buf/udmabuf0/size"
    size.write_text("many\n")
    assert driver.answers([], "files", str(root)) == [f"error: {size} contains 'many', which is not a number"]
    size.unlink()
    assert driver.answers([], "files", str(root)) == [f"error: cannot read {size}; check whether the driver is loaded"]
