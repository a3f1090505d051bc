"""The one interface to the hardware: frames to it, bursts from it.

    with transport:
        transport.send(pack_frame(0, payload))          # waits while the hardware takes no more
        burst = transport.receive(timeout=1.0)          # None if none came in time

A simulator's pipe, a UART and AXI DMA all are one. The same in C++ is `firm/transport.hpp` in the folder `cpp` above.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import TracebackType
from typing import Protocol


class TransportError(Exception):
    """The hardware, or the way to it, is gone or does what it must not; the transport is of no more use."""


class TransportResetError(TransportError):
    """The hardware began anew, and the transport goes on: what was under way in either direction is lost."""


@dataclass(frozen=True)
class Burst:
    """The bytes of the system's stream up to a `tlast`, those that `tkeep` marks: a frame, or a part of one.

    `tid` is the stream's where the transport carries it. Simulated hardware says in which cycles of clk the first and
    the last beat were taken.
    """

    data: bytes
    tid: int | None = None
    first_cycle: int | None = None
    last_cycle: int | None = None


class Transport(Protocol):
    """One thread may send while another one receives; closing ends both."""

    def send(self, frame: bytes) -> None:
        """Send a whole frame; returns when the hardware, or a bounded buffer, has it. Raises `TransportError`."""

    def receive(self, timeout: float | None = None) -> Burst | None:
        """The next burst; None if none came in `timeout` seconds (None: wait for ever), or when it is closed.

        Raises `TransportError`, and of that `TransportResetError` where frames that have begun are to be forgotten.
        """

    def is_at_rest(self) -> bool | None:
        """Whether all that was sent has had its effect, and all of that was received; None where no one can know."""

    def close(self) -> None:
        """Stop; what has been sent may be lost. A second call does nothing."""

    def __enter__(self) -> Transport:
        """The transport itself; it is open since it was made."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it."""
