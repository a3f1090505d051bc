"""The status of a node in fabric, as a transport for the frames that access it: each is the payload of a datagram.

A datagram may be lost, so a request is repeated until it is answered. A repeated access reads the same word, or a newer
value of a counter; a write is repeated.
"""

from __future__ import annotations

import socket
import time

from fusesoc_firm.node.transport.transport import Burst, Closing, TransportError
from fusesoc_firm.system.status_frames import answered, status_answer

# The kind of the addresses of such nodes, and the port of firm_net_status.
UDP = "udp"
PORT = 7399
_REPEAT_SECONDS = 0.25
_WORD_BYTES = 4
_MOST_BYTES = 100


class UdpStatus(Closing):
    """A transport to the status of the node at an IPv4 address."""

    def __init__(self, address: str) -> None:
        """Open a socket. Raise `TransportError` if the address is not a host's."""
        self._address = address
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._payload = b""
        # The last fault since the last request.
        self._fault: OSError | None = None
        try:
            self._socket.connect((address, PORT))
        except OSError as error:
            self._socket.close()
            raise self._unreachable(error) from None

    def send(self, frame: bytes) -> None:
        """Send a request; all other frames are dropped."""
        if (asked := answered(frame)) is not None:
            self._payload = b"".join(item.to_bytes(_WORD_BYTES, "little") for item in asked)
            self._empty()
            self._fault = None
            self._ask()

    def receive(self, timeout: float | None = None) -> Burst | None:
        """Return the answer to the last request, or None after `timeout` seconds, or without a request.

        Raise `TransportError` if the host or its port could not be reached in this time.
        """
        end = None if timeout is None else time.monotonic() + timeout
        while self._payload and (end is None or time.monotonic() < end):
            left = _REPEAT_SECONDS if end is None else min(_REPEAT_SECONDS, max(0.001, end - time.monotonic()))
            self._socket.settimeout(left)
            try:
                found = self._socket.recv(_MOST_BYTES)
            except TimeoutError:
                self._ask()
                continue
            except OSError as error:
                # The host or its port is not yet available.
                self._fault = error
                time.sleep(left)
                self._ask()
                continue
            if len(found) == len(self._payload) and found[:_WORD_BYTES] == self._payload[:_WORD_BYTES]:
                self._payload = b""
                words = (found[:_WORD_BYTES], found[_WORD_BYTES:])
                return Burst(status_answer(*(int.from_bytes(word, "little") for word in words)))
        if self._payload and self._fault:
            raise self._unreachable(self._fault)
        return None

    def is_ready(self) -> bool:
        """Return True, since a request never waits."""
        return True

    def is_at_rest(self) -> bool | None:
        """Return None, since the node's frames are unknown."""
        return None

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _ask(self) -> None:
        try:
            self._socket.send(self._payload)
        except OSError as error:
            # It is repeated later, like a lost datagram.
            self._fault = error

    def _empty(self) -> None:
        """Drop received datagrams, since a late answer would be assigned to the next request."""
        self._socket.settimeout(0.0)
        while True:
            try:
                self._socket.recv(_MOST_BYTES)
            except BlockingIOError:
                return
            except OSError:
                # The fault of an earlier request.
                continue

    def _unreachable(self, error: OSError) -> TransportError:
        return TransportError(f"the node at '{self._address}' cannot be reached: {error.strerror}")
