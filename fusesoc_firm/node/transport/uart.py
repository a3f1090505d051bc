"""Hardware on a serial line (cores/board, robot:board:firm_link): 8 bits, no parity, 1 stop bit.

    with UartTransport("/dev/ttyUSB1") as transport:
        transport.send(pack_frame(0, payload))
        burst = transport.receive(timeout=1.0)          # a whole frame, since a link carries no parts of frames
        transport.counts.broken                         # frames from the board that were dropped

`link_code` describes the frames on the line. A frame from the board that has a wrong checksum is dropped, counted and
reported, and the next one is received. On opening, the transport sends a break, which ends an incomplete frame of an
earlier host.
"""

from __future__ import annotations

import os
import select
import termios
import threading
import time
from collections import deque

from fusesoc_firm.node.transport.link_code import Counts, LinkDecoder, encode
from fusesoc_firm.node.transport.transport import Burst, Closing, LostFrameError, TransportError

DEFAULT_BAUD = 1_000_000
"""The default of the hardware's generic BAUD; a board may set another one."""

_CHUNK_BYTES = 65536


class UartTransport(Closing):
    """A transport over a serial line."""

    def __init__(
        self, device: str, baud: int = DEFAULT_BAUD, *, has_flow_control: bool = False, longest: int = 2**26
    ) -> None:
        """Open `device`. If `has_flow_control` is set, RTS and CTS control the flow of data.

        No payload has more than `longest` bytes. May raise `TransportError`.
        """
        self._device = device
        self._decoder = LinkDecoder(longest)
        self._frames: deque[bytes | None] = deque()
        self._receiving = threading.Lock()
        self._sending = threading.Lock()
        self._is_closed = False
        speed = getattr(termios, f"B{baud}", None)
        if not speed:
            raise TransportError(f"{baud} is not a legal baud rate; legal: 115200, 1000000, 2000000 and others")
        try:
            self._line = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError as error:
            raise TransportError(f"cannot open the serial line {device}: {error.strerror}") from None
        # `close` writes to this pipe to wake waiting threads.
        self._wake, self._woken = os.pipe()
        try:
            _configure(self._line, speed, has_flow_control=has_flow_control)
            # Bytes that wait to be sent or read are those of an earlier host.
            termios.tcflush(self._line, termios.TCIOFLUSH)
            termios.tcsendbreak(self._line, 0)
        except termios.error as error:
            self.close()
            raise TransportError(f"{device} is not a serial line: {error.args[-1]}") from None

    @property
    def counts(self) -> Counts:
        """The frames from the board so far, good and broken."""
        return self._decoder.counts

    def send(self, frame: bytes) -> None:
        """Send a whole frame; wait while the line is busy or held. May raise `TransportError`."""
        rest = memoryview(encode(frame))
        with self._sending:
            while rest:
                if self._is_closed:
                    raise TransportError("the transport is closed")
                select.select([self._wake], [self._line], [])
                rest = rest[self._write(rest) :]

    def is_ready(self) -> bool:
        """Return False, because a line needs time for each frame."""
        return False

    def receive(self, timeout: float | None = None) -> Burst | None:
        """Return the next frame as a burst. May raise `TransportError`, and `LostFrameError` for a broken frame."""
        with self._receiving:
            return self._receive(timeout)

    def is_at_rest(self) -> None:
        """Return None, because the line cannot determine whether the hardware is working."""

    def close(self) -> None:
        """Close the line. A second call does nothing."""
        if self._is_closed:
            return
        self._is_closed = True
        os.close(self._woken)
        # Do not close a descriptor that a thread still uses, since another file could then receive the same number.
        with self._receiving, self._sending:
            os.close(self._line)
            os.close(self._wake)

    def _receive(self, timeout: float | None) -> Burst | None:
        end = None if timeout is None else time.monotonic() + timeout
        while not self._is_closed:
            if self._frames:
                return self._burst(self._frames.popleft())
            rest = None if end is None else max(0.0, end - time.monotonic())
            if self._is_readable(rest):
                self._frames += self._decoder.push(self._read())
            elif rest is not None:
                return None
        return None

    def _burst(self, frame: bytes | None) -> Burst:
        if frame is None:
            raise LostFrameError(f"{self._device}: a frame from the board was broken on the line; it is dropped")
        return Burst(frame)

    def _is_readable(self, seconds: float | None) -> bool:
        return self._line in select.select([self._line, self._wake], [], [], seconds)[0]

    def _read(self) -> bytes:
        try:
            data = os.read(self._line, _CHUNK_BYTES)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise self._gone(error.strerror) from None
        if not data:
            raise self._gone("the device hung up")
        return data

    def _write(self, data: memoryview) -> int:
        try:
            return os.write(self._line, data[:_CHUNK_BYTES])
        except BlockingIOError:
            return 0
        except OSError as error:
            raise self._gone(error.strerror) from None

    def _gone(self, reason: str | None) -> TransportError:
        return TransportError("the transport is closed" if self._is_closed else f"{self._device} is lost: {reason}")


def _configure(line: int, speed: int, *, has_flow_control: bool) -> None:
    """Configure a line for raw bytes at a speed, given as a constant of termios."""
    control = termios.CS8 | termios.CREAD | termios.CLOCAL
    if has_flow_control:
        control |= termios.CRTSCTS
    special = termios.tcgetattr(line)[6]
    # Ignore received breaks, do not echo, and do not wait for complete lines of text.
    termios.tcsetattr(line, termios.TCSANOW, [termios.IGNBRK, 0, control, 0, speed, speed, special])
