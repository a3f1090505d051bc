"""AXI DMA in C++ before a model of the engine that watches the rules of descriptors, and its device made of files."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.node.drivers import Driver, cpp_driver

SEED = 20261123
# Some frames are the record of an aborted frame.
RECORD_BYTES = 7


@pytest.fixture(scope="module")
def driver() -> Driver:
    return cpp_driver("dma")


def play(driver: Driver, count: int, longest: int, buffer: int, fault: str = "none", at: int = 0) -> str:
    return driver.answers([], *map(str, [count, longest, buffer, SEED, fault, at]))[0]


@pytest.mark.one_in(2)
@pytest.mark.parametrize(
    ("count", "longest", "buffer"), [(500, 300, 64), (500, 300, 1024), (20, 100_000, 4096), (50, 0, 0)]
)
def test_frames_go_there_and_back(driver: Driver, count: int, longest: int, buffer: int) -> None:
    """Also those that are longer than a buffer, and than all of them."""
    print(f"seed {SEED}")
    word, size, _ = play(driver, count, longest, buffer).split()
    assert word == "ok" and count * 5 <= int(size) <= count * (longest + RECORD_BYTES)


@pytest.mark.parametrize(
    ("fault", "error"),
    [
        ("decode", "the DMA engine's MM2S: DMADecErr (address)"),
        ("slave", "the DMA engine's S2MM: DMASlvErr (response from memory)"),
        ("halt", "the DMA engine's S2MM: the channel has halted"),
        ("stall", "the transport is closed"),
        ("overrun", "the DMA engine wrote past the end of a buffer"),
        ("simple", "the DMA engine does not support scatter-gather, so it is not from a generated block design"),
        ("reset", "the DMA engine does not leave reset; check the engine's clock"),
        ("start", "the DMA engine does not start"),
    ],
)
def test_errors_of_the_engine_are_named(driver: Driver, fault: str, error: str) -> None:
    assert play(driver, 100, 100, 64, fault, 10) == f"error: {error}"


@pytest.mark.parametrize("size", [63, 100, 1 << 21])
def test_illegal_buffers_are_named(driver: Driver, size: int) -> None:
    assert play(driver, 1, 1, size) == (
        f"error: the DMA has 4 buffers of {size} bytes; legal: 2 or more, a multiple of 64, and all within the"
        " 4194304 bytes of memory"
    )


def _device(root: Path, address: str = "0x3f000000", kind: str = "u-dma-buf") -> Path:
    """The files of UIO and u-dma-buf."""
    texts = {
        "sys/class/uio/uio3/maps/map0/size": "0x10000\n",
        f"sys/class/{kind}/udmabuf0/phys_addr": f"{address}\n",
        f"sys/class/{kind}/udmabuf0/size": "8192\n",
        f"sys/class/{kind}/udmabuf0/sync_mode": "1\n",
    }
    for name, text in texts.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    (root / "dev").mkdir()
    registers = bytearray(65536)
    registers[0x34:0x38] = (77).to_bytes(4, "little")
    (root / "dev/uio3").write_bytes(registers)
    (root / "dev/udmabuf0").write_bytes(bytes(8192))
    return root


@pytest.mark.parametrize("kind", ["u-dma-buf", "udmabuf"])
def test_a_device_of_files(driver: Driver, tmp_path: Path, kind: str) -> None:
    root = _device(tmp_path, kind=kind)
    assert driver.answers([], "files", str(root)) == [f"ok 77 8192 {0x3F000000}"]
    assert (root / "dev/uio3").read_bytes()[0x30:0x34] == (0x1234567).to_bytes(4, "little")
    assert (root / "dev/udmabuf0").read_bytes()[5] == 0xAB
    # Not cached, and not a device's memory either.
    assert (root / f"sys/class/{kind}/udmabuf0/sync_mode").read_text() == "2"


def test_a_device_that_does_not_serve_is_named(driver: Driver, tmp_path: Path) -> None:
    root = _device(tmp_path, "0xfffff000")
    far = driver.answers([], "files", str(root))
    assert far == ["error: udmabuf0 ends beyond the 4 GiB that the DMA engine reaches"]
    size = root / "sys/class/u-dma-buf/udmabuf0/size"
    size.write_text("many\n")
    assert driver.answers([], "files", str(root)) == [f"error: {size} contains 'many', which is not a number"]
    size.unlink()
    assert driver.answers([], "files", str(root)) == [f"error: cannot read {size}; check whether the driver is loaded"]
