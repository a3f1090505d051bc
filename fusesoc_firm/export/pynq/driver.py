"""The driver of a system in a PYNQ overlay, which sends and receives messages as dictionaries.

    with Quat2eulerOverlay() as overlay:                 # loads the bitstream
        overlay.send("sub", {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0})
        publisher, message = overlay.receive(timeout=1.0)

`firm pynq` writes the class of a system, with its table. Nothing runs in the background: what the system has sent stays
in the buffers of the engine until a call of `send` or `receive` takes it. Codec, frames, bursts and transports are
those of the nodes.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar, NamedTuple, Protocol, Self

from fusesoc_firm.api.codec import Codec, codec
from fusesoc_firm.frame.codec import MessageValue, pack_frame
from fusesoc_firm.message.middleware import middleware_of
from fusesoc_firm.node.engine.bursts import BurstJoiner
from fusesoc_firm.node.transport.dma import DmaTransport
from fusesoc_firm.node.transport.pynq_channels import ChannelTransport, Dma
from fusesoc_firm.node.transport.pynq_device import PynqDmaDevice
from fusesoc_firm.node.transport.transport import Closing, Transport
from fusesoc_firm.text.diagnostics import fail, nearest

# The engine in generated block designs, by its name in the overlay.
ENGINE = "dma"
_MEBIBYTE = 2**20
_PAUSE_SECONDS = 1e-3
_SCATTER_GATHER = "c_include_sg"


class Topic(NamedTuple):
    """A topic at the hardware: the id of its frames, its message, the version of ROS."""

    id: int
    message: str
    ros: int


class Received(NamedTuple):
    """A message from the system, and the block that published it."""

    publisher: str
    message: dict[str, Any]


class EngineTransport(Transport, Protocol):
    """A transport that tells whether a frame has to wait."""

    def has_room(self, size: int) -> bool:
        """Return whether a frame of this size in bytes can be sent without a wait. May raise `TransportError`."""


class Driver(Closing):
    """The base class of the driver of each system, whose table it has in its class variables.

    `BITSTREAM` is the path of the `.bit` file, beside which is the `.hwh` file. `MESSAGES` is the folder of the
    definitions. `WIDTH` is that of the streams in bits. `LONGEST` is the longest payload from the system in bytes, or
    None without a bound. `IS_PREEMPTIVE` if frames from the system come in bursts.
    """

    BITSTREAM: ClassVar[Path]
    MESSAGES: ClassVar[Path]
    WIDTH: ClassVar[int]
    LONGEST: ClassVar[int | None]
    IS_PREEMPTIVE: ClassVar[bool]
    SUBSCRIBERS: ClassVar[Mapping[str, Topic]]
    PUBLISHERS: ClassVar[Mapping[str, Topic]]

    def __init__(
        self,
        bitstream: str | Path | None = None,
        *,
        download: bool = True,
        mebibytes: int = 4,
        transport: EngineTransport | None = None,
    ) -> None:
        """Load an overlay, by default the package's own; with `transport`, use a system that is already loaded.

        Without `download`, the FPGA keeps its content, and only the system is reset. The buffers of a DMA engine with
        scatter-gather share `mebibytes` of memory. Raise `InputError` without PYNQ or a file, and `TransportError` if
        the engine does not work.
        """
        self.subscribers = {block: self._codec(topic) for block, topic in self.SUBSCRIBERS.items()}
        self.publishers = {block: self._codec(topic) for block, topic in self.PUBLISHERS.items()}
        self._names = {topic.id: block for block, topic in self.PUBLISHERS.items()}
        self._joiner = BurstJoiner(len(self.PUBLISHERS), self.WIDTH, self.LONGEST)
        self._received: deque[Received] = deque()
        self.overlay: Any = None
        if transport is None:
            pynq = _pynq()
            self.overlay = pynq.Overlay(str(_existing(Path(bitstream or self.BITSTREAM))), download=download)
            transport = _transport(pynq, self.overlay, mebibytes)
        self._transport = transport

    @classmethod
    def over(cls, dma: Dma, allocate: Callable[..., Any], *, size: int = 2**16, drives_tkeep: bool = True) -> Self:
        """Use a system of a loaded overlay by the channels of its engine, such as `overlay.dma`; `allocate` is PYNQ's.

        No frame or burst has more than `size` bytes. If the engine does not drive `tkeep`, as that of cocotbpynq,
        `tkeep` of the system is tied to ones, and frames fill whole beats. Raise `InputError` if the system does not
        accept this, and `TransportError` if the engine does not work.
        """
        if not drives_tkeep:
            cls._check_whole_beats()
        return cls(transport=ChannelTransport(dma, allocate, size, 0 if drives_tkeep else cls._beat_bytes()))

    def send(self, subscriber: str, *messages: MessageValue, timeout: float | None = None) -> None:
        """Send messages to a subscriber, one after the other; received messages are kept meanwhile.

        Raise `TimeoutError` if the system does not accept a message within `timeout` seconds (None: no limit),
        `CodecError` for a message that does not fit, `InputError` for an unknown subscriber, and the errors of
        `receive`.
        """
        if subscriber not in self.SUBSCRIBERS:
            fail(f"'{subscriber}' is not a subscriber", hint=nearest(subscriber, self.SUBSCRIBERS))
        frames = [pack_frame(self.SUBSCRIBERS[subscriber].id, self._payload(subscriber, item)) for item in messages]
        for number, frame in enumerate(frames):
            end = _end(timeout)
            while not self._transport.has_room(len(frame)):
                if time.monotonic() > end:
                    raise TimeoutError(f"'{subscriber}' did not accept message {number} within {timeout} s")
                # A system that cannot send accepts nothing.
                self._take(_PAUSE_SECONDS)
            self._transport.send(frame)

    def receive(self, timeout: float | None = None) -> Received | None:
        """Return the next message of any publisher, or None after `timeout` seconds (None: no limit) or if closed.

        Raise `TransportError` if the hardware is lost, `BurstError` for a broken or aborted frame, and `CodecError` for
        a payload that is not valid. After the last two, the next call continues.
        """
        end = _end(timeout)
        while not self._received:
            rest = None if timeout is None else max(0.0, end - time.monotonic())
            # Without a limit, only a closed transport ends a wait.
            if not self._take(rest) and (rest is None or time.monotonic() >= end):
                return None
        return self._received.popleft()

    def receive_all(self, count: int, timeout: float | None = None) -> list[Received]:
        """Return the next `count` messages, or those that arrive within `timeout` seconds; errors as for `receive`."""
        end = _end(timeout)
        found: list[Received] = []
        while len(found) < count:
            item = self.receive(None if timeout is None else max(0.0, end - time.monotonic()))
            if item is None:
                break
            found.append(item)
        return found

    def close(self) -> None:
        """Stop the engine; the system stays in the FPGA. A second call does nothing."""
        self._transport.close()

    @classmethod
    def _beat_bytes(cls) -> int:
        return cls.WIDTH // 8

    @classmethod
    def _check_whole_beats(cls) -> None:
        """Raise `InputError` unless zeros may follow each message up to the end of a beat."""
        if cls.IS_PREEMPTIVE:
            fail("the engine must drive tkeep: with a preemptive scheduler, a burst does not tell its end")
        for block, topic in cls.SUBSCRIBERS.items():
            most = middleware_of(topic.ros).rules.trailing_bytes
            if most < cls._beat_bytes() - 1:
                fail(
                    f"the engine must drive tkeep: '{block}' accepts {most} bytes after a message,"
                    f" and a beat has {cls._beat_bytes()} bytes",
                    hint="legal without tkeep: width 8, or ROS 2 with a width of at most 32",
                )

    def _codec(self, topic: Topic) -> Codec:
        return codec(topic.message, topic.ros, [self.MESSAGES / f"ros{topic.ros}"])

    def _payload(self, subscriber: str, message: MessageValue) -> bytes:
        return self.subscribers[subscriber].encode(message)

    def _take(self, timeout: float | None) -> bool:
        """Wait for a burst, and keep the message that it completes; return whether there was a burst."""
        burst = self._transport.receive(timeout)
        if burst is None:
            return False
        frame = self._joiner.push(burst.data, burst.tid, is_aborted=burst.is_aborted)
        if frame:
            block = self._names[frame.id]
            self._received.append(Received(block, self.publishers[block].decode(frame.payload)))
        return True


def _end(timeout: float | None) -> float:
    return float("inf") if timeout is None else time.monotonic() + timeout


def _pynq() -> ModuleType:
    """Import PYNQ, which only boards have. May raise `InputError`."""
    try:
        return import_module("pynq")
    except ImportError as error:
        fail(f"PYNQ cannot be imported: {error}", hint="run this on a board with PYNQ, or give a transport")


def _existing(bitstream: Path) -> Path:
    """Return the path of a bitstream; raise `InputError` without this file or the description of its hardware."""
    for path in (bitstream, bitstream.with_suffix(".hwh")):
        if not path.is_file():
            fail(f"there is no file {path}", hint="Vivado writes it; the package's README.md names the place")
    return bitstream


def _transport(pynq: ModuleType, overlay: Any, mebibytes: int) -> EngineTransport:
    """Return the transport for the overlay's engine, with scatter-gather or without."""
    if ENGINE not in overlay.ip_dict:
        fail(f"the overlay has no '{ENGINE}'", hint=f"its IP: {', '.join(overlay.ip_dict)}")
    description = overlay.ip_dict[ENGINE]
    # PYNQ's own driver sends no frame that is shorter than two beats of memory, and receives no unknown length.
    if int(description["parameters"].get(_SCATTER_GATHER, 1)):
        registers = pynq.MMIO(description["phys_addr"], description["addr_range"])
        memory = pynq.allocate(shape=(mebibytes * _MEBIBYTE,), dtype="u1")
        return DmaTransport(PynqDmaDevice(registers, memory))
    return ChannelTransport(getattr(overlay, ENGINE), pynq.allocate)
