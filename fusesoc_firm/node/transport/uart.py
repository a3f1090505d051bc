"""Hardware on a serial line (cores/board, robot:board:firm_link): raw frames, 8 bits, no parity, 1 stop bit.

    with UartTransport("/dev/ttyUSB1") as transport:
        transport.send(pack_frame(0, payload))
        burst = transport.receive(timeout=1.0)          # a whole frame, since a link carries no parts of frames

A byte stream does not mark the start of a frame. To the board, a break marks it: the next byte begins a frame. From the
board, only silence marks it. The transport uses both markers when it is opened, and again when received bytes cannot
form a frame: after an illegal length, or after a pause in the middle of a frame.
"""

from __future__ import annotations

import os
import select
import termios
import threading
import time
from types import TracebackType

from fusesoc_firm.frame.model import ID_BYTES, LENGTH_BYTES
from fusesoc_firm.node.transport.transport import Burst, TransportError, TransportResetError

DEFAULT_BAUD = 1_000_000
"""The default of the hardware's generic BAUD; a board may set another one."""

_HEADER_BYTES = ID_BYTES + LENGTH_BYTES
_CHUNK_BYTES = 65536
# The silence that separates frames after bytes were lost; a USB adapter may delay bytes by milliseconds.
_SILENT_SECONDS = 0.05
# After this time without silence, the transport gives up on the board.
_MOST_SILENCE_SECONDS = 2.0
# The longest pause in the middle of a frame from the board.
_LONGEST_PAUSE_SECONDS = 0.2


class UartTransport:
    """A transport over a serial line."""

    def __init__(
        self, device: str, baud: int = DEFAULT_BAUD, *, has_flow_control: bool = False, longest: int = 2**26
    ) -> None:
        """Open `device`. If `has_flow_control` is set, RTS and CTS control the flow of data.

        No payload has more than `longest` bytes. May raise `TransportError`.
        """
        self._device = device
        self._longest = longest
        self._begun = bytearray()
        self._receiving = threading.Lock()
        self._sending = threading.Lock()
        self._writing = threading.Lock()
        self._cuts = 0
        self._last_byte = 0.0  # time of its arrival
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
            self._cut()
        except termios.error as error:
            self.close()
            raise TransportError(f"{device} is not a serial line: {error.args[-1]}") from None

    def send(self, frame: bytes) -> None:
        """Send a whole frame; wait while the line is busy or held. May raise `TransportError`.

        Raise `TransportResetError` if a break ends the frame.
        """
        rest = memoryview(frame)
        with self._sending:
            cuts = self._cuts
            while rest:
                if self._is_closed:
                    raise TransportError("the transport is closed")
                # While flow control holds the line, check repeatedly for a break from the board.
                select.select([self._wake], [self._line], [], _LONGEST_PAUSE_SECONDS)
                with self._writing:
                    if self._cuts != cuts:
                        raise TransportResetError(f"{self._device}: a break interrupted a frame")
                    rest = rest[self._write(rest) :]

    def receive(self, timeout: float | None = None) -> Burst | None:
        """Return the next frame as a burst. May raise `TransportError`, or `TransportResetError` for illegal bytes."""
        with self._receiving:
            return self._receive(timeout)

    def is_at_rest(self) -> None:
        """Return None, because the line cannot tell whether the hardware is working."""

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

    def __enter__(self) -> UartTransport:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _receive(self, timeout: float | None) -> Burst | None:
        end = None if timeout is None else time.monotonic() + timeout
        while not self._is_closed:
            if frame := self._next_frame():
                return Burst(frame)
            rest = None if end is None else max(0.0, end - time.monotonic())
            pause = self._last_byte + _LONGEST_PAUSE_SECONDS - time.monotonic() if self._begun else None
            if self._is_readable(_least(rest, pause)):
                self._begun += self._read()
                self._last_byte = time.monotonic()
            elif pause is not None and (rest is None or pause <= rest):
                self._begin_anew("a frame is incomplete")
            elif rest is not None:
                return None
        return None

    def _cut(self) -> None:
        """Send a break; drop all bytes received before the break and all bytes that wait to be sent."""
        with self._writing:
            self._cuts += 1
            termios.tcflush(self._line, termios.TCOFLUSH)
            termios.tcsendbreak(self._line, 0)
        end = time.monotonic() + _MOST_SILENCE_SECONDS
        while self._is_readable(_SILENT_SECONDS):
            self._read()
            if time.monotonic() > end:
                raise TransportError(f"{self._device} is never silent, so the start of a frame cannot be found")
        self._begun.clear()

    def _begin_anew(self, why: str) -> None:
        if self._is_closed:
            return
        self._cut()
        raise TransportResetError(f"{self._device}: {why}; bytes were lost")

    def _is_readable(self, seconds: float | None) -> bool:
        return self._line in select.select([self._line, self._wake], [], [], seconds)[0]

    def _next_frame(self) -> bytes | None:
        """Return the next complete frame, or None while it is incomplete."""
        if len(self._begun) < _HEADER_BYTES:
            return None
        length = int.from_bytes(self._begun[ID_BYTES:_HEADER_BYTES], "little")
        if length > self._longest:
            self._begin_anew(f"a frame announces {length} bytes, more than {self._longest}")
        end = _HEADER_BYTES + length
        if len(self._begun) < end:
            return None
        frame = bytes(self._begun[:end])
        del self._begun[:end]
        return frame

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


def _least(*seconds: float | None) -> float | None:
    """Return the shortest of several time limits; None means no limit."""
    return min((max(0.0, item) for item in seconds if item is not None), default=None)
