"""The single interface to the hardware, which sends frames and receives bursts.

    with transport:
        transport.send(pack_frame(0, payload))          # waits while the hardware is not ready
        burst = transport.receive(timeout=1.0)          # None if no burst arrived in time

A simulator's pipe, a UART and AXI DMA implement this interface. `../cpp/firm/transport.hpp` is the C++ version.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self


class TransportError(Exception):
    """The hardware or the path to it is lost or violates the protocol; the transport is unusable."""


class TransportResetError(TransportError):
    """The hardware was reset, and the transport continues: all data in transit in either direction is lost."""


class LostFrameError(TransportError):
    """A frame from the hardware was broken in transit and is dropped; the transport continues."""


@dataclass(frozen=True)
class Burst:
    """The valid bytes (by `tkeep`) of the system's stream up to a `tlast`: a frame or a part of a frame.

    `tid` is the stream's `tid`, if the transport carries it. `is_aborted` if the burst aborts its frame. For simulated
    hardware, the burst also contains the clk cycles in which the first and the last beat were accepted.
    """

    data: bytes
    tid: int | None = None
    first_cycle: int | None = None
    last_cycle: int | None = None
    is_aborted: bool = False


class Closing(ABC):
    """An object that a `with` statement closes at its end."""

    @abstractmethod
    def close(self) -> None:
        """Close the object."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Transport(Protocol):
    """A path to the hardware. One thread may send while another receives; closing the transport ends both calls."""

    def send(self, frame: bytes) -> None:
        """Send a whole frame; return when the hardware, or a bounded buffer, has it. May raise `TransportError`."""

    def is_ready(self) -> bool:
        """Return whether the hardware accepts the next frame without a wait; False also if unknown."""

    def receive(self, timeout: float | None = None) -> Burst | None:
        """Return the next burst, or None after `timeout` seconds (None: no limit) or when the transport is closed.

        May raise `TransportError`, in particular `TransportResetError` if incomplete frames must be dropped, and
        `LostFrameError` if one frame was lost.
        """

    def is_at_rest(self) -> bool | None:
        """Return whether all sent frames are processed and all responses are received, or None if this is unknown."""

    def close(self) -> None:
        """Close the transport; sent frames may be lost. A second call does nothing."""

    def __enter__(self) -> Transport:
        """Return the transport, which was opened at its creation."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the transport."""
