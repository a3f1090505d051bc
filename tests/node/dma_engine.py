"""AXI DMA in scatter-gather mode: one model of the registers and descriptors for the drivers in Python, C++ and C.

Written from AMD's product guide PG021. A channel halts with an error bit where the guide says so: a descriptor that is
already complete (SGIntErr), a length of 0 (DMAIntErr), an address beyond the memory (SGDecErr, DMADecErr); a test can
have any error at any frame. What the guide leaves undefined, and what only a driver of firm promises, breaks a rule and
is in `Engine.broken`.

QEMU's model (7.2) parts from both: it never shows SGIncld, and S2MM's descriptors get no count of bytes. Linux's driver
agrees: it knows scatter-gather by SGIncld, waits until the reset bit is cleared, and takes the same bits for errors. It
also serves an engine without scatter-gather, which firm's drivers refuse.
"""

from __future__ import annotations

import mmap
import os
import select
import socket
import struct
import threading
import time
import tty
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from fusesoc_firm.node.transport.simulator import SimulatorTransport

MM2S, S2MM = 0x00, 0x30
_CONTROL, _STATUS, _CURRENT, _CURRENT_HIGH, _TAIL, _TAIL_HIGH = range(0x00, 0x18, 4)
_RUN, _RESET, _RESERVED_ONE = 1 << 0, 1 << 2, 1 << 1
HALTED, _IDLE, _HAS_SG = 1 << 0, 1 << 1, 1 << 3
_COMPLETE_INTERRUPT, _DELAY_INTERRUPT, _ERROR_INTERRUPT = 1 << 12, 1 << 13, 1 << 14
_INTERRUPTS = _COMPLETE_INTERRUPT | _DELAY_INTERRUPT | _ERROR_INTERRUPT
DMA_INTERNAL, DMA_SLAVE, DMA_DECODE, SG_INTERNAL, SG_SLAVE, SG_DECODE = (1 << bit for bit in (4, 5, 6, 8, 9, 10))
ERRORS = (DMA_INTERNAL, DMA_SLAVE, DMA_DECODE, SG_INTERNAL, SG_SLAVE, SG_DECODE)
# The errors of a transfer are also in its descriptor: bits 28 to 30.
_TO_DESCRIPTOR = 24
_COMPLETE, _START, _END = 1 << 31, 1 << 27, 1 << 26
_DESCRIPTOR = struct.Struct("<IIII8xII")
_STATUS_PLACE = 0x1C
_DESCRIPTOR_BYTES = 64
# A step of the delay interrupt: 125 clocks, at 100 MHz.
_DELAY_SECONDS = 1.25e-6
_ACCESS = struct.Struct("<II")
_WRITE = 1
_GLANCE = 0.02


@dataclass(frozen=True)
class Built:
    """How the engine was built, and how long it takes."""

    has_scatter_gather: bool = True
    address_bits: int = 32
    length_bits: int = 26
    beat_bytes: int = 64
    reset_seconds: float = 0.002
    starts: bool = True


@dataclass(frozen=True)
class Fault:
    """What goes wrong, and at which frame of a channel: error bits, or a reset by somebody else."""

    frame: int
    channel: int = MM2S
    bits: int = 0
    is_reset: bool = False
    is_silent: bool = False
    """The channel halts without an error."""
    is_stalled: bool = False
    is_too_long: bool = False
    """A descriptor tells more bytes than its buffer has."""


class Stream(Protocol):
    """The system behind the engine: pieces of frames go in and come out."""

    def put(self, piece: bytes, *, is_last: bool, is_over: Callable[[], bool]) -> None:
        """Take a piece, waiting for room; give up when `is_over`."""

    def wait(self, seconds: float) -> None:
        """Wait for a piece, but not for longer."""

    def get(self) -> tuple[bytes, bool] | None:
        """Return the next piece and whether it ends its frame; None if there is none yet."""

    def clear(self) -> None:
        """Forget everything: a reset."""


class Loop:
    """A system that sends everything back and holds a few pieces."""

    def __init__(self, room: int = 4) -> None:
        self._room = room
        self._pieces: deque[tuple[bytes, bool]] = deque()
        self._changed = threading.Condition()

    def put(self, piece: bytes, *, is_last: bool, is_over: Callable[[], bool]) -> None:
        """Take a piece."""
        with self._changed:
            while len(self._pieces) >= self._room and not is_over():
                self._changed.wait(_GLANCE)
            if not is_over():
                self._pieces.append((piece, is_last))
            self._changed.notify_all()

    def wait(self, seconds: float) -> None:
        """Wait for a piece."""
        with self._changed:
            self._changed.wait_for(lambda: self._pieces, seconds)

    def get(self) -> tuple[bytes, bool] | None:
        """Return the next piece."""
        with self._changed:
            piece = self._pieces.popleft() if self._pieces else None
            self._changed.notify_all()
            return piece

    def clear(self) -> None:
        """Forget all pieces."""
        with self._changed:
            self._pieces.clear()
            self._changed.notify_all()


class Simulated:
    """A simulated system, whose frames the engine exchanges through `transport`; a reset does not reach it."""

    def __init__(self, transport: SimulatorTransport) -> None:
        self._transport = transport
        self._frame = b""
        self._bursts: deque[bytes] = deque()

    def put(self, piece: bytes, *, is_last: bool, is_over: Callable[[], bool]) -> None:
        """Take a piece."""
        del is_over
        self._frame += piece
        if is_last:
            self._transport.send(self._frame)
            self._frame = b""

    def wait(self, seconds: float) -> None:
        """Wait for a burst."""
        if not self._bursts and (burst := self._transport.receive(seconds)) is not None:
            self._bursts.append(burst.data)

    def get(self) -> tuple[bytes, bool] | None:
        """Return the next burst."""
        return (self._bursts.popleft(), True) if self._bursts else None

    def clear(self) -> None:
        """Forget what was not sent and what was received."""
        self._frame = b""
        self._bursts.clear()


class _Channel:
    """A direction: its registers, and where it stands in the list of descriptors."""

    def __init__(self, built: Built) -> None:
        self._built = built
        self.frames = 0
        self.reset()

    def reset(self) -> None:
        self.control = _RESERVED_ONE | 1 << 16
        self._status = HALTED | (_HAS_SG if self._built.has_scatter_gather else 0)
        self.current = self.tail = self.written_tail = 0
        self.has_descriptors = False
        self.is_between_frames = True
        self._left = 1
        self._delay_end: float | None = None

    @property
    def threshold(self) -> int:
        return self.control >> 16 & 0xFF

    @property
    def is_halted(self) -> bool:
        return bool(self._status & HALTED)

    @property
    def may_work(self) -> bool:
        return not self.is_halted and bool(self.control & _RUN) and self.has_descriptors

    @property
    def interrupts(self) -> bool:
        return bool(self.status & self.control & _INTERRUPTS)

    @property
    def status(self) -> int:
        self._expire()
        idle = _IDLE if not self.is_halted and not self.has_descriptors else 0
        return self._status | idle | self._left << 16

    def set_control(self, value: int) -> None:
        threshold = value >> 16 & 0xFF or self.threshold
        if threshold != self.threshold:
            self._left = threshold
        self.control = value & 0xFF00_7000 | value & _RUN | _RESERVED_ONE | threshold << 16
        if not value & _RUN:
            self._status |= HALTED
        elif self._built.starts:
            self._status &= ~HALTED

    def acknowledge(self, value: int) -> None:
        self._expire()
        self._status &= ~(value & _INTERRUPTS)

    def halt(self, bits: int) -> None:
        self.control &= ~_RUN
        self._status |= HALTED | bits | (_ERROR_INTERRUPT if bits else 0)

    def advance(self, following: int, *, is_end: bool) -> None:
        """A descriptor is complete: go on to the following, and count the end of a frame for the interrupts."""
        self.has_descriptors = self.current != self.tail
        self.current = following
        self.is_between_frames = is_end
        if not is_end:
            return
        self.frames += 1
        self._left -= 1
        if self._left == 0:
            self._interrupt(_COMPLETE_INTERRUPT)
        elif delay := self.control >> 24:
            self._delay_end = time.monotonic() + delay * _DELAY_SECONDS

    def _expire(self) -> None:
        if self._delay_end is not None and time.monotonic() >= self._delay_end:
            self._interrupt(_DELAY_INTERRUPT)

    def _interrupt(self, bit: int) -> None:
        self._status |= bit
        self._left, self._delay_end = self.threshold, None


class Engine:
    """The engine: `read` and `write` are the driver's seam, and threads work off the descriptors."""

    def __init__(
        self, memory: memoryview, address: int, stream: Stream | None = None, built: Built | None = None
    ) -> None:
        """Make an engine that reaches `memory`, whose first byte is at `address`."""
        self._memory, self._address = memory, address
        self._stream: Stream = stream or Loop()
        self._built = built or Built()
        self._changed = threading.Condition()
        self._channels = {MM2S: _Channel(self._built), S2MM: _Channel(self._built)}
        self._reset_end: float | None = None
        self._is_own_reset = True
        self._is_over = False
        self.resets = 0
        self.is_held = False
        """MM2S takes nothing."""
        self.parts: list[int] = []
        """The bytes of the descriptors that MM2S has taken."""
        self.faults: list[Fault] = []
        self.broken: list[str] = []
        self._threads = [threading.Thread(target=work) for work in (self._send, self._receive)]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """End the engine."""
        with self._changed:
            self._is_over = True
            self._changed.notify_all()
        for thread in self._threads:
            thread.join()

    def read(self, offset: int) -> int:
        """Return the value of a register."""
        with self._changed:
            place, channel = self._place(offset)
            if place == _CONTROL:
                return channel.control | (_RESET if self._is_resetting() else 0)
            if place == _STATUS:
                return channel.status
            if place in (_CURRENT, _TAIL):
                return (channel.current if place == _CURRENT else channel.tail) & 0xFFFF_FFFF
            return self._break(f"a register that is not read: {offset:#x}")

    def write(self, offset: int, value: int) -> None:
        """Set a register."""
        with self._changed:
            place, channel = self._place(offset)
            if place == _CONTROL and value & _RESET:
                self._reset(is_own=True)
            elif self._is_resetting():
                # It has no effect. Of a reset by somebody else, the driver cannot know.
                if self._is_own_reset:
                    self._break(f"register {offset:#x} is written during a reset")
            elif place == _CONTROL:
                channel.set_control(value)
            elif place == _STATUS:
                channel.acknowledge(value)
            elif place in (_CURRENT, _CURRENT_HIGH):
                self._point(channel, place, value)
            elif place in (_TAIL, _TAIL_HIGH):
                self._hand_over(channel, place, value)
            else:
                self._break(f"a register that is not written: {offset:#x}")
            self._changed.notify_all()

    def halt(self, channel: int, bits: int = 0) -> None:
        """Halt a channel with these error bits."""
        with self._changed:
            self._channels[channel].halt(bits)
            self._changed.notify_all()

    def wait_for_interrupt(self, is_over: Callable[[], bool]) -> bool:
        """Wait until S2MM's interrupt is raised; return whether it is."""
        with self._changed:
            while not (self._is_over or is_over()):
                if self._channels[S2MM].interrupts:
                    return True
                self._changed.wait(_GLANCE)
            return False

    # --- registers ----------------------------------------------------------------------------------------------------

    def _place(self, offset: int) -> tuple[int, _Channel]:
        return offset % S2MM, self._channels[S2MM if offset >= S2MM else MM2S]

    def _break(self, rule: str) -> int:
        self.broken.append(rule)
        return 0

    def _is_resetting(self) -> bool:
        return self._reset_end is not None and time.monotonic() < self._reset_end

    def _reset(self, *, is_own: bool) -> None:
        """Reset both channels, whichever is told; by the driver, or by somebody else."""
        self.resets += 1
        self._is_own_reset = is_own
        self._reset_end = time.monotonic() + self._built.reset_seconds
        for channel in self._channels.values():
            channel.reset()
        self._stream.clear()

    def _point(self, channel: _Channel, place: int, value: int) -> None:
        if not channel.is_halted:
            self._break("the first descriptor is written while the channel runs")
        channel.current = self._address_of(channel.current, place == _CURRENT_HIGH, value)

    def _hand_over(self, channel: _Channel, place: int, value: int) -> None:
        """The lower half counts for a channel of 32 bits, the upper half for one that has it."""
        channel.written_tail = self._address_of(channel.written_tail, place == _TAIL_HIGH, value)
        # A driver may not have noticed yet that the channel has halted.
        if not channel.is_halted and (place == _TAIL_HIGH or self._built.address_bits == 32):
            channel.tail = channel.written_tail
            channel.has_descriptors = True

    def _address_of(self, before: int, is_high: bool, value: int) -> int:
        if is_high and self._built.address_bits == 32:
            return self._break("an upper half is written to an engine of 32 bits") or before
        if is_high:
            return before & 0xFFFF_FFFF | value << 32
        if value % _DESCRIPTOR_BYTES:
            self._break(f"a descriptor at {value:#x}")
        return before >> 32 << 32 | value

    # --- descriptors --------------------------------------------------------------------------------------------------

    def _send(self) -> None:
        """MM2S: from memory to the stream."""
        while (work := self._next(MM2S, lambda: not self.is_held)) is not None:
            channel, resets, (following, place, control) = work
            size = control & self._longest()
            is_end = bool(control & _END)
            with self._changed:
                if resets != self.resets:
                    continue
                if bool(control & _START) != channel.is_between_frames:
                    self._break("a frame begins within another one, or none does")
                if not is_end and size % self._built.beat_bytes:
                    self._break("a frame goes on behind half a beat")
                data = bytes(self._memory[place : place + size])
                self.parts.append(size)
            self._stream.put(data, is_last=is_end, is_over=lambda: self._is_over or resets != self.resets)  # noqa: B023
            self._complete(channel, resets, size, following, is_end=is_end)

    def _receive(self) -> None:
        """S2MM: from the stream to memory."""
        data, is_last, resets = b"", False, -1
        while not self._is_over:
            if resets != self.resets or not data:
                self._stream.wait(_GLANCE)
                with self._changed:
                    resets = self.resets
                    data, is_last = self._stream.get() or (b"", False)
                continue
            if (work := self._next(S2MM, lambda: True, resets)) is None:
                continue
            channel, _, (following, place, control) = work
            size = min(control & self._longest(), len(data))
            with self._changed:
                if resets != self.resets:
                    continue
                self._memory[place : place + size] = data[:size]
                data = data[size:]
                is_end = is_last and not data
                start = _START if channel.is_between_frames else 0
            told = self._longest() if self._has(S2MM, "is_too_long") else size
            self._complete(channel, resets, told | start | (_END if is_end else 0), following, is_end=is_end)

    def _next(
        self, name: int, is_free: Callable[[], bool], resets: int | None = None
    ) -> tuple[_Channel, int, tuple[int, int, int]] | None:
        """Wait for a descriptor; return the channel, the resets so far, and the descriptor's content.

        None at the end, and after another reset than the number `resets`.
        """
        channel = self._channels[name]
        with self._changed:
            while not self._is_over and resets in (None, self.resets):
                is_stalled = self._has(name, "is_stalled")
                if channel.may_work and not self._is_resetting() and is_free() and not is_stalled:
                    if (descriptor := self._load(name, channel)) is not None:
                        return channel, self.resets, descriptor
                    continue
                self._changed.wait(_GLANCE)
            return None

    def _load(self, name: int, channel: _Channel) -> tuple[int, int, int] | None:
        """Fetch a descriptor: the address of the next, the place of its buffer, its control word; None if it halts."""
        if (fault := self._due(name)) is not None:
            self.faults.remove(fault)
            if fault.is_reset:
                self._reset(is_own=False)
            else:
                self._fail(channel, fault.bits)
            return None
        place = self._inside(channel.current, _DESCRIPTOR_BYTES)
        if place is None:
            return self._fail(channel, SG_DECODE)
        following, following_high, buffer, buffer_high, control, status = _DESCRIPTOR.unpack_from(self._memory, place)
        size = control & self._longest()
        if status & _COMPLETE:
            return self._fail(channel, SG_INTERNAL)
        if size == 0:
            return self._fail(channel, DMA_INTERNAL)
        if self._built.address_bits > 32:
            following, buffer = following | following_high << 32, buffer | buffer_high << 32
        if buffer % self._built.beat_bytes:
            self._break(f"a buffer at {buffer:#x}")
        inside = self._inside(buffer, size)
        return self._fail(channel, DMA_DECODE) if inside is None else (following, inside, control)

    def _due(self, name: int) -> Fault | None:
        """Return the fault that comes now and stops the channel."""
        count = self._channels[name].frames
        return next(
            (
                fault
                for fault in self.faults
                if fault.channel == name and fault.frame <= count and (fault.bits or fault.is_reset or fault.is_silent)
            ),
            None,
        )

    def _has(self, name: int, kind: str) -> bool:
        """Return whether a fault of a kind that stays has begun."""
        count = self._channels[name].frames
        return any(fault.channel == name and fault.frame <= count and getattr(fault, kind) for fault in self.faults)

    def _fail(self, channel: _Channel, bits: int) -> tuple[int, int, int] | None:
        """Halt; the errors of a transfer are written to its descriptor, which is not complete. Return no descriptor."""
        place = self._inside(channel.current, _DESCRIPTOR_BYTES)
        transfer = bits & (DMA_INTERNAL | DMA_SLAVE | DMA_DECODE)
        if transfer and place is not None:
            struct.pack_into("<I", self._memory, place + _STATUS_PLACE, transfer << _TO_DESCRIPTOR)
        channel.halt(bits)
        return None

    def _complete(self, channel: _Channel, resets: int, status: int, following: int, *, is_end: bool) -> None:
        with self._changed:
            place = self._inside(channel.current, _DESCRIPTOR_BYTES)
            if resets != self.resets or place is None:
                return
            struct.pack_into("<I", self._memory, place + _STATUS_PLACE, status | _COMPLETE)
            channel.advance(following, is_end=is_end)
            self._changed.notify_all()

    def _inside(self, address: int, size: int) -> int | None:
        place = address - self._address
        return place if place >= 0 and place + size <= len(self._memory) else None

    def _longest(self) -> int:
        return (1 << self._built.length_bits) - 1


# --- the files of a board ---------------------------------------------------------------------------------------------

ADDRESS = 0x3000_0000
REGISTER_BYTES = 4096


def board_files(root: Path, size: int = 1 << 16, address: int = ADDRESS, kind: str = "u-dma-buf") -> Path:
    """Write what Linux shows of UIO and u-dma-buf, with memory of `size` bytes; return its file."""
    folder = f"sys/class/{kind}/udmabuf0"
    values = {
        "sys/class/uio/uio0/maps/map0/size": hex(REGISTER_BYTES),
        f"{folder}/phys_addr": hex(address),
        f"{folder}/size": str(size),
        f"{folder}/sync_mode": "1",
    }
    for name, value in values.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(f"{value}\n")
    (root / "dev").mkdir(exist_ok=True)
    memory = root / "dev/udmabuf0"
    memory.touch()
    os.truncate(memory, size)
    return memory


@contextmanager
def board(
    root: Path,
    size: int = 1 << 16,
    address: int = ADDRESS,
    *,
    stream: Stream | None = None,
    built: Built | None = None,
    faults: Sequence[Fault] = (),
) -> Iterator[Engine]:
    """A board with an engine: its files below `root`, and the registers at the socket `root/registers`.

    Fails if the driver breaks a rule.
    """
    path = board_files(root, size, address)
    with path.open("r+b") as file:
        memory = memoryview(mmap.mmap(file.fileno(), 0))
    engine = Engine(memory, address, stream, built)
    engine.faults.extend(faults)
    try:
        with _served(engine, root / "registers"), _interrupting(engine, root / "dev/uio0"):
            yield engine
    finally:
        engine.close()
    assert not engine.broken, engine.broken[0]


@contextmanager
def _served(engine: Engine, path: Path) -> Iterator[None]:
    """Serve the registers at a UNIX socket: the register's offset (plus 1: a write) and a value in, a value out."""
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))
        listener.listen()
        stopped = threading.Event()
        thread = threading.Thread(target=_serve, args=(engine, listener, stopped))
        thread.start()
        try:
            yield
        finally:
            stopped.set()
            thread.join()


def _serve(engine: Engine, listener: socket.socket, stopped: threading.Event) -> None:
    clients: dict[int, socket.socket] = {}
    while not stopped.is_set():
        for ready in select.select([listener, *clients.values()], [], [], _GLANCE)[0]:
            if ready is listener:
                client = listener.accept()[0]
                clients[client.fileno()] = client
            elif not _answer(engine, ready):
                clients.pop(ready.fileno()).close()
    for client in clients.values():
        client.close()


def _answer(engine: Engine, client: socket.socket) -> bool:
    """Do one access; return False at the end."""
    try:
        request = client.recv(_ACCESS.size, socket.MSG_WAITALL)
        if len(request) < _ACCESS.size:
            return False
        offset, value = _ACCESS.unpack(request)
        if offset & _WRITE:
            engine.write(offset & ~_WRITE, value)
        else:
            value = engine.read(offset)
        client.sendall(struct.pack("<I", value))
    except ConnectionError:
        return False
    return True


@contextmanager
def _interrupting(engine: Engine, device: Path) -> Iterator[None]:
    """Play UIO's file `device` by a pseudo-terminal: a word enables the interrupt, a word tells that it came."""
    controller, line = os.openpty()
    tty.setraw(line)
    device.symlink_to(os.ttyname(line))
    stopped = threading.Event()
    thread = threading.Thread(target=_interrupt, args=(engine, controller, stopped))
    thread.start()
    try:
        yield
    finally:
        stopped.set()
        thread.join()
        os.close(controller)
        os.close(line)


def _interrupt(engine: Engine, controller: int, stopped: threading.Event) -> None:
    count = 0
    while not stopped.is_set():
        if _drained(controller, _GLANCE) and engine.wait_for_interrupt(stopped.is_set):
            # UIO forgets how often it was enabled.
            _drained(controller, 0)
            count += 1
            os.write(controller, struct.pack("<I", count))


def _drained(controller: int, seconds: float) -> bool:
    """Return whether anything was there to read, within some seconds."""
    return bool(select.select([controller], [], [], seconds)[0] and os.read(controller, 4096))
