"""The transport over AXI DMA, against a thread that plays the engine: files in place of registers and shared memory."""

from __future__ import annotations

import mmap
import random
import threading
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path

import pytest

from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.node.bursts import AbortedFrameError, BurstJoiner, JoinedFrame
from fusesoc_firm.node.transport.dma import (
    BUFFER,
    COMPLETE,
    CONTROL,
    DESCRIPTOR_CONTROL,
    DESCRIPTOR_STATUS,
    END_OF_FRAME,
    FIRST_DESCRIPTOR,
    FROM_SYSTEM,
    LAST_DESCRIPTOR,
    LENGTH,
    NEXT,
    START_OF_FRAME,
    STATUS,
    TO_SYSTEM,
    Control,
    DmaBuffers,
    DmaTransport,
    Status,
)
from fusesoc_firm.node.transport.dma_device import LinuxDmaDevice
from fusesoc_firm.node.transport.open_transport import open_transport
from fusesoc_firm.node.transport.transport import Burst, TransportError

SEED = 20241103
ADDRESS = 0x3000_0000
MEMORY_BYTES = 1 << 16
REGISTER_BYTES = 4096


def mapped(path: Path) -> memoryview:
    with path.open("r+b") as file:
        return memoryview(mmap.mmap(file.fileno(), 0))


class Channel:
    """A direction of the engine: where it stands in the list of descriptors."""

    def __init__(self, registers: memoryview, memory: memoryview, first_register: int) -> None:
        self._registers, self._memory, self._first = registers, memory, first_register
        self.stop()

    def register(self, offset: int) -> int:
        return self._registers[(self._first + offset) // 4]

    def set(self, offset: int, value: int) -> None:
        self._registers[(self._first + offset) // 4] = value

    def stop(self) -> None:
        self._current = 0
        self.set(LAST_DESCRIPTOR, 0)
        self.set(STATUS, Status.HALTED | Status.HAS_SCATTER_GATHER)
        # The driver waits for this.
        self.set(CONTROL, 0)

    def start(self) -> None:
        if self.register(CONTROL) & Control.RUN and self.register(STATUS) & Status.HALTED:
            self._current = self.register(FIRST_DESCRIPTOR)
            self.set(STATUS, self.register(STATUS) & ~Status.HALTED)

    def descriptor(self) -> int | None:
        """The place of the next descriptor that is handed over; None while there is none.

        A file does not tell how often it was written, so a ring that was filled again is known by its descriptors.
        """
        if not self.register(LAST_DESCRIPTOR):
            return None
        place = (self._current - ADDRESS) // 4
        words = self.words()
        is_handed_over = words[place + DESCRIPTOR_CONTROL] and not words[place + DESCRIPTOR_STATUS] & COMPLETE
        return place if is_handed_over else None

    def words(self) -> memoryview:
        return self._memory.cast("I")

    def finish(self, place: int, status: int) -> None:
        words = self.words()
        assert not words[place + DESCRIPTOR_STATUS] & COMPLETE
        words[place + DESCRIPTOR_STATUS] = status | COMPLETE
        self._current = words[place + NEXT]


class Engine:
    """AXI DMA with a system behind it that sends each frame back."""

    def __init__(self, root: Path) -> None:
        registers, memory = mapped(root / "dev/uio0").cast("I"), mapped(root / "dev/udmabuf0")
        self._memory = memory
        self.to_system = Channel(registers, memory, TO_SYSTEM)
        self.from_system = Channel(registers, memory, FROM_SYSTEM)
        self.resets = 0
        self.is_held = False
        self.bursts: deque[bytes] = deque()
        self.parts: list[int] = []
        self._frame = bytearray()
        self._left = b""
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def stop(self) -> None:
        self._is_over.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._is_over.wait(0.0002):
            if self.to_system.register(CONTROL) & Control.RESET:
                self.resets += 1
                self.bursts.clear()
                self._frame, self._left = bytearray(), b""
                self.from_system.stop()
                self.to_system.stop()
            self.to_system.start()
            self.from_system.start()
            while not self.is_held and (place := self.to_system.descriptor()) is not None:
                self._take(place)
            while (self.bursts or self._left) and (place := self.from_system.descriptor()) is not None:
                self._give(place)

    def _take(self, place: int) -> None:
        words = self.to_system.words()
        control = words[place + DESCRIPTOR_CONTROL]
        assert bool(control & START_OF_FRAME) == (not self._frame)
        first = words[place + BUFFER] - ADDRESS
        self._frame += self._memory[first : first + (control & LENGTH)]
        self.parts.append(control & LENGTH)
        self.to_system.finish(place, control & LENGTH)
        if control & END_OF_FRAME:
            self.bursts.append(bytes(self._frame))
            self._frame.clear()

    def _give(self, place: int) -> None:
        words = self.from_system.words()
        first, size = words[place + BUFFER] - ADDRESS, words[place + DESCRIPTOR_CONTROL] & LENGTH
        start = 0 if self._left else START_OF_FRAME
        data = self._left or self.bursts.popleft()
        part, self._left = data[:size], data[size:]
        self._memory[first : first + len(part)] = part
        self.from_system.finish(place, len(part) | start | (0 if self._left else END_OF_FRAME))


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """The files of the devices."""
    values = {
        "sys/class/uio/uio0/maps/map0/size": hex(REGISTER_BYTES),
        "sys/class/u-dma-buf/udmabuf0/phys_addr": hex(ADDRESS),
        "sys/class/u-dma-buf/udmabuf0/size": str(MEMORY_BYTES),
        "sys/class/u-dma-buf/udmabuf0/sync_mode": "1",
        "dev/uio0": "\0" * REGISTER_BYTES,
        "dev/udmabuf0": "\0" * MEMORY_BYTES,
    }
    for name, value in values.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(value)
    return tmp_path


@pytest.fixture
def engine(root: Path) -> Iterator[Engine]:
    made = Engine(root)
    yield made
    made.stop()


def device(root: Path) -> LinuxDmaDevice:
    return LinuxDmaDevice("/dev/uio0", "udmabuf0", has_interrupt=False, root=root)


@pytest.mark.parametrize("size", [0, 64, 256])
def test_frames_there_and_back(root: Path, engine: Engine, size: int) -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED)
    payloads = [bytes(range(256)), b"", *(source.randbytes(source.randrange(3000)) for _ in range(60))]
    frames = [pack_frame(number % 4, payload) for number, payload in enumerate(payloads)]
    with DmaTransport(device(root), DmaBuffers(5, 3, size)) as transport:

        def send() -> None:
            for frame in frames:
                transport.send(frame)

        sender = threading.Thread(target=send)
        sender.start()
        for frame in frames:
            assert transport.receive(60) == Burst(frame)
        sender.join()
        assert transport.receive(0.01) is None
        last = engine.to_system.register(LAST_DESCRIPTOR)
        assert last == ADDRESS + 64 * ((len(engine.parts) - 1) % 5)
    # Frames go in parts where the buffers are small.
    assert max(engine.parts) == (size or max(map(len, frames)))
    assert engine.resets == 2
    assert (root / "sys/class/u-dma-buf/udmabuf0/sync_mode").read_text() == "2"


class Patient(LinuxDmaDevice):
    """An engine whose interrupt does not come; it is waited for, but not for longer than this many seconds."""

    longest = 0.0

    def wait(self, timeout: float | None) -> None:
        assert timeout is not None
        self.longest = max(self.longest, timeout)
        super().wait(timeout)


def test_a_frame_may_be_longer_than_all_buffers(root: Path, engine: Engine) -> None:
    """Its interrupt comes at its end, which the engine reaches only if somebody looks before."""
    patient = Patient("/dev/uio0", "udmabuf0", has_interrupt=False, root=root)
    frame = pack_frame(1, random.Random(SEED).randbytes(3000))
    with DmaTransport(patient, DmaBuffers(4, 2, 64)) as transport:
        sender = threading.Thread(target=transport.send, args=(frame,))
        sender.start()
        assert transport.receive() == Burst(frame)
        sender.join()
    assert 0 < patient.longest < 1


def test_a_record_aborts_a_frame(root: Path, engine: Engine) -> None:
    """The part of the frame that was sent, then the record of the hardware; the next frame is whole."""
    part, record, frame = b"\1\x64\0\0\0abc", b"\xff" * 5 + b"\1\x0a", pack_frame(1, b"de")
    joiner = BurstJoiner(4, 8)
    with DmaTransport(device(root)) as transport:
        for burst in (part, record, frame):
            transport.send(burst)
        bursts = [transport.receive(60) for _ in range(3)]
    assert bursts == [Burst(part), Burst(b"\1", is_aborted=True), Burst(frame)]
    assert joiner.push(part) is None
    with pytest.raises(AbortedFrameError, match="the frame with id 1 was aborted"):
        joiner.push(b"\1", is_aborted=True)
    assert joiner.push(frame) == JoinedFrame(1, b"de")


def test_buffers_that_the_engine_keeps_hold_the_sender(root: Path, engine: Engine) -> None:
    sent: list[int] = []
    refusals: list[str] = []
    with DmaTransport(device(root), DmaBuffers(4, 4)) as transport:
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


def test_closing_wakes_who_waits(root: Path, engine: Engine) -> None:
    found: list[Burst | None] = []
    transport = DmaTransport(device(root))
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


@pytest.mark.parametrize(
    ("bits", "message"),
    [
        (1 << 6, "the DMA engine's S2MM: DMADecErr"),
        (1 << 8 | 1 << 5, "DMASlvErr .response from memory., SGIntErr"),
        (1, "S2MM: the channel has halted"),
    ],
)
def test_a_fault_of_the_engine(root: Path, engine: Engine, bits: int, message: str) -> None:
    with DmaTransport(device(root)) as transport:
        engine.stop()
        engine.from_system.set(STATUS, engine.from_system.register(STATUS) | bits)
        with pytest.raises(TransportError, match=message):
            transport.receive(60)


def test_an_engine_that_is_none(root: Path, engine: Engine) -> None:
    engine.stop()
    with pytest.raises(TransportError, match="does not leave reset"):
        DmaTransport(device(root))


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
