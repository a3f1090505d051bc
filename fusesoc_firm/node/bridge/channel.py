"""The socket between a node's engine and its bridge: a stream of parcels.

The module needs only the standard library of Python 3.8, since both ends import it.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
from typing import NamedTuple

# CONFIGURE, to the bridge: its configuration. READY, from the bridge: the names of the topics after remapping.
CONFIGURE, READY = b"C", b"R"
# MESSAGE, in both directions: a message from a topic, or a message to publish. PUBLISHED, from the bridge, on request:
# the message is published.
MESSAGE, PUBLISHED = b"M", b"P"
# LOST, from the bridge: the number of messages of a topic that ROS did not deliver, as text.
LOST = b"L"
# CALL, from the bridge: a call of the hardware's service; to the bridge: a call by the hardware. ANSWER, the other way:
# the answer to a call. The topic is the number of the service.
CALL, ANSWER = b"Q", b"A"
# PARAMETERS, from the bridge: new values of parameters, as JSON with the number of the request; to the bridge: the
# reason why they are refused, or an empty text, in the same form.
PARAMETERS = b"V"
# LOG, to the bridge: a line for ROS's log, as text; the topic is its level, a number of `logging`.
LOG = b"G"
# The number of the topic `/diagnostics`.
DIAGNOSTICS = 0xFFFF
# STOP, to the bridge: accept no more messages. From the bridge: ROS requests the end of the node.
STOP = b"S"
# DONE, from the bridge: all messages accepted before STOP are handed over. FAULT, from the bridge: the error that ended
# the bridge.
DONE, FAULT = b"D", b"E"

# The kind, the number of the topic, a time of the system's monotonic clock in ns, and the number of bytes that follow.
_HEADER = struct.Struct("<cHqI")
# The number of a call; whether it was answered.
_CALL, _ANSWER = struct.Struct("<Q"), struct.Struct("<Q?")


def pack_call(number: int, payload: bytes) -> bytes:
    """Return the data of a CALL."""
    return _CALL.pack(number) + payload


def unpack_call(data: bytes) -> tuple[int, bytes]:
    """Return the number and the payload of a CALL."""
    return _CALL.unpack_from(data)[0], data[_CALL.size :]


def pack_answer(number: int, payload: bytes | None, reason: str = "") -> bytes:
    """Return the data of an ANSWER; without a payload, the call has failed for a reason."""
    return _ANSWER.pack(number, payload is not None) + (reason.encode() if payload is None else payload)


def unpack_answer(data: bytes) -> tuple[int, bytes | None, str]:
    """Return the number, the payload and the reason of an ANSWER."""
    number, is_answered = _ANSWER.unpack_from(data)
    rest = data[_ANSWER.size :]
    return (number, rest, "") if is_answered else (number, None, rest.decode(errors="replace"))


class Parcel(NamedTuple):
    """The unit of transfer over the socket."""

    kind: bytes
    topic: int
    time_ns: int
    data: bytes


class Channel:
    """One end of the socket. Any thread may send; only one may receive."""

    def __init__(self, end: socket.socket) -> None:
        self._socket = end
        self._file = end.makefile("rb", 1 << 16)
        self._lock = threading.Lock()

    def send(self, kind: bytes, topic: int = 0, data: bytes = b"", time_ns: int = 0) -> None:
        """Send a parcel; block while the other end does not read. Raise OSError if the other end is closed."""
        header = _HEADER.pack(kind, topic, time_ns, len(data))
        with self._lock:
            if len(data) < 1 << 16:
                self._socket.sendall(header + data)
            else:
                self._socket.sendall(header)
                self._socket.sendall(data)

    def receive(self) -> Parcel | None:
        """Return the next parcel, or None if the other end is closed, even in the middle of a parcel."""
        try:
            header = self._file.read(_HEADER.size)
            if len(header) < _HEADER.size:
                return None
            kind, topic, time_ns, size = _HEADER.unpack(header)
            data = self._file.read(size)
        except (OSError, ValueError):  # ValueError: this end is closed.
            return None
        return None if len(data) < size else Parcel(kind, topic, time_ns, data)

    def finish(self) -> None:
        """Close the sending direction; the other end sees the end of the stream."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_WR)

    def is_closed(self) -> bool:
        """Return whether the other end is closed and nothing is left to receive."""
        try:
            return not self._socket.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT)
        except BlockingIOError:
            return False
        except OSError:
            return True

    def close(self) -> None:
        """Close this end and wake all threads that wait for data from the socket."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        # The socket stays open until its file is closed.
        self._file.close()
        self._socket.close()
