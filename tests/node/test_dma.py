"""The transport over AXI DMA before the model of the engine, and its device made of files."""

from __future__ import annotations

import random
import re
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.node.engine.bursts import AbortedFrameError, BurstJoiner, JoinedFrame
from fusesoc_firm.node.transport.dma import FROM_SYSTEM, LAST_DESCRIPTOR, TO_SYSTEM, DmaBuffers, DmaTransport
from fusesoc_firm.node.transport.dma_device import LinuxDmaDevice
from fusesoc_firm.node.transport.open_transport import open_transport
from fusesoc_firm.node.transport.transport import Burst, TransportError
from tests.node.dma_engine import (
    ADDRESS,
    DMA_DECODE,
    DMA_INTERNAL,
    DMA_SLAVE,
    REGISTER_BYTES,
    SG_DECODE,
    SG_INTERNAL,
    SG_SLAVE,
    Built,
    Engine,
    board,
    board_files,
)
from tests.seeds import seeded

SEED = seeded(20241103)


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """The files of the devices, with registers that nobody plays."""
    board_files(tmp_path)
    (tmp_path / "dev/uio0").write_bytes(bytes(REGISTER_BYTES))
    return tmp_path


@pytest.fixture
def engine(tmp_path: Path) -> Iterator[Engine]:
    with board(tmp_path) as made:
        yield made


def device(root: Path, engine: Engine | None = None, *, has_interrupt: bool = True) -> LinuxDmaDevice:
    is_played = engine is not None
    return LinuxDmaDevice(
        "/dev/uio0", "udmabuf0", has_interrupt=is_played and has_interrupt, root=root, registers=engine
    )


@pytest.mark.parametrize(("size", "has_interrupt"), [(0, True), (64, True), (256, False)])
def test_frames_there_and_back(tmp_path: Path, engine: Engine, size: int, has_interrupt: bool) -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED)
    payloads = [bytes(range(256)), b"", *(source.randbytes(source.randrange(3000)) for _ in range(60))]
    frames = [pack_frame(number % 4, payload) for number, payload in enumerate(payloads)]
    with DmaTransport(device(tmp_path, engine, has_interrupt=has_interrupt), DmaBuffers(5, 3, size)) as transport:

        def send() -> None:
            for frame in frames:
                transport.send(frame)

        sender = threading.Thread(target=send)
        sender.start()
        for frame in frames:
            assert transport.receive(60) == Burst(frame)
        sender.join()
        assert transport.receive(0.01) is None
        last = engine.read(TO_SYSTEM + LAST_DESCRIPTOR)
        assert last == ADDRESS + 64 * ((len(engine.parts) - 1) % 5)
    # Frames go in parts where the buffers are small.
    assert max(engine.parts) == (size or max(map(len, frames)))
    assert engine.resets == 2
    assert (tmp_path / "sys/class/u-dma-buf/udmabuf0/sync_mode").read_text() == "2"


def test_a_frame_may_be_longer_than_all_buffers(tmp_path: Path, engine: Engine) -> None:
    """Its interrupt comes at its end, which the engine reaches only if somebody looks before."""
    frame = pack_frame(1, random.Random(SEED).randbytes(3000))
    with DmaTransport(device(tmp_path, engine), DmaBuffers(4, 2, 64)) as transport:
        sender = threading.Thread(target=transport.send, args=(frame,))
        sender.start()
        assert transport.receive() == Burst(frame)
        sender.join()


def test_a_record_aborts_a_frame(tmp_path: Path, engine: Engine) -> None:
    """The part of the frame that was sent, then the record of the hardware; the next frame is whole."""
    part, record, frame = b"\1\x64\0\0\0abc", b"\xff" * 5 + b"\1\x0a", pack_frame(1, b"de")
    joiner = BurstJoiner(4, 8)
    with DmaTransport(device(tmp_path, engine)) as transport:
        for burst in (part, record, frame):
            transport.send(burst)
        bursts = [transport.receive(60) for _ in range(3)]
    assert bursts == [Burst(part), Burst(b"\1", is_aborted=True), Burst(frame)]
    assert joiner.push(part) is None
    with pytest.raises(AbortedFrameError, match="the frame with id 1 was aborted"):
        joiner.push(b"\1", is_aborted=True)
    assert joiner.push(frame) == JoinedFrame(1, b"de")


def test_buffers_that_the_engine_keeps_hold_the_sender(tmp_path: Path, engine: Engine) -> None:
    sent: list[int] = []
    refusals: list[str] = []
    with DmaTransport(device(tmp_path, engine), DmaBuffers(4, 4)) as transport:
        engine.is_held = True

        def send() -> None:
            try:
                for number in range(9):
                    transport.send(b"frame")
                    sent.append(number)
            except TransportError as error:
                refusals.append(str(error))

        sender = threading.Thread(target=send)
        sender.start()
        while len(sent) < 4:
            time.sleep(0.01)
        time.sleep(0.1)
        assert sent == [0, 1, 2, 3]
    sender.join()
    assert refusals == ["the transport is closed"]


def test_closing_wakes_who_waits(tmp_path: Path, engine: Engine) -> None:
    found: list[Burst | None] = []
    transport = DmaTransport(device(tmp_path, engine))
    receiver = threading.Thread(target=lambda: found.append(transport.receive()))
    receiver.start()
    time.sleep(0.05)
    transport.close()
    transport.close()
    receiver.join()
    assert found == [None]
    assert engine.resets == 2
    with pytest.raises(TransportError, match="the transport is closed"):
        transport.send(b"late")


@pytest.mark.parametrize("channel", [TO_SYSTEM, FROM_SYSTEM])
@pytest.mark.parametrize(
    ("bits", "message"),
    [
        (DMA_INTERNAL, "DMAIntErr (internal)"),
        (DMA_SLAVE, "DMASlvErr (response from memory)"),
        (DMA_DECODE, "DMADecErr (address)"),
        (SG_INTERNAL, "SGIntErr (descriptor)"),
        (SG_SLAVE, "SGSlvErr (response from memory)"),
        (SG_DECODE, "SGDecErr (address)"),
        (SG_INTERNAL | DMA_SLAVE, "DMASlvErr (response from memory), SGIntErr (descriptor)"),
        (0, "the channel has halted"),
    ],
)
def test_a_fault_of_the_engine(tmp_path: Path, engine: Engine, channel: int, bits: int, message: str) -> None:
    """It is told to who receives, whichever direction it is in: nobody may be sending."""
    with DmaTransport(device(tmp_path, engine)) as transport:
        engine.halt(channel, bits)
        name = "MM2S" if channel == TO_SYSTEM else "S2MM"
        with pytest.raises(TransportError, match=re.escape(f"the DMA engine's {name}: {message}")):
            transport.receive(60)


@pytest.mark.parametrize(
    ("built", "message"),
    [
        (Built(reset_seconds=1e9), "does not leave reset"),
        (Built(has_scatter_gather=False), "does not support scatter-gather"),
        (Built(starts=False), "does not start"),
    ],
)
def test_an_engine_that_is_none(tmp_path: Path, built: Built, message: str) -> None:
    with board(tmp_path, built=built) as engine, pytest.raises(TransportError, match=message):
        DmaTransport(device(tmp_path, engine))


@pytest.mark.parametrize(
    "buffers", [DmaBuffers(1, 4), DmaBuffers(4, 1), DmaBuffers(4, 4, 100), DmaBuffers(4, 4, 1 << 15)]
)
def test_buffers_that_cannot_be(root: Path, buffers: DmaBuffers) -> None:
    with pytest.raises(TransportError, match="legal: 2 or more, a multiple of 64, and all within the 65536"):
        DmaTransport(device(root), buffers)


@pytest.mark.parametrize(
    ("file", "value", "message"),
    [
        ("sys/class/uio/uio0/maps/map0/size", None, "cannot read .*map0/size; check whether the driver is loaded"),
        ("sys/class/u-dma-buf/udmabuf0/phys_addr", "soon", "phys_addr contains 'soon', which is not a number"),
        ("sys/class/u-dma-buf/udmabuf0/phys_addr", "0xffff8000", "udmabuf0 ends beyond the 4 GiB"),
        ("sys/class/u-dma-buf/udmabuf0/phys_addr", "0x1020", "begins at 0x1020, which is not a multiple of 64"),
        ("dev/uio0", None, "cannot use .*No such file"),
    ],
)
def test_devices_that_cannot_be_used(root: Path, file: str, value: str | None, message: str) -> None:
    if value is None:
        (root / file).unlink()
    else:
        (root / file).write_text(value)
    with pytest.raises(TransportError, match=message):
        device(root)


def test_its_address() -> None:
    with pytest.raises(TransportError, match=r"^cannot read /sys/class/udmabuf/none/phys_addr"):
        open_transport("dma:/dev/uio0:none:poll")
    with pytest.raises(TransportError, match=r"legal: .*dma:UIO:BUFFER\[:poll\]"):
        open_transport("dma:/dev/uio0")
