"""The status of hardware that a node uses, for other processes on the same computer.

    with StatusServer(served_names("robot", "uart:/dev/ttyUSB1:1000000"), node.access_status, print):
        ...                                     # the node runs

    with open_status("uart:/dev/ttyUSB1:1000000") as transport:     # another process: asks the node, if there is one
        print(status_text(read_status(transport)))

The sockets are abstract sockets of Linux, so that a killed node leaves no files. They are named after the node's system
(`node:robot`) and after the device of its transport. A packet is a request; the reply is the answer of the hardware, or
the reason of a failure as text. The request `parameter 0` is for the node itself: it replies with a parameter of the
hardware as JSON (block, name, type, default, least and most value), or with `null` after the last one. Both sides
refuse peers of other users except root; root itself may ask any node.
`cpp/firm/status_server.hpp` is the C++ version of the server.
"""

from __future__ import annotations

import json
import os
import select
import socket
import struct
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from itertools import count

from fusesoc_firm.message.wire import INTEGER_AND_FLOAT
from fusesoc_firm.node.transport.open_transport import device_of, open_transport
from fusesoc_firm.node.transport.status_registers import AXI, open_registers_at
from fusesoc_firm.node.transport.transport import Burst, Closing, Transport, TransportError
from fusesoc_firm.node.transport.udp import UDP, UdpStatus
from fusesoc_firm.system.derived.model import BlockParameter, Parameter
from fusesoc_firm.system.status_frames import answered

NODE = "node"
_PREFIX = b"\0firm status "
_LONGEST_NAME = 90
_LONGEST_PACKET = 1000
_WAITING_PEERS = 8
# A request for the description of a parameter begins with this word; no frame of the status does.
_PARAMETER = b"parameter "
# A peer that is silent for this time must reconnect.
_SILENCE_SECONDS = 5.0


def served_names(system: str, address: str) -> tuple[str, ...]:
    """Return the names of the sockets of a node: after its system, and after the device at its transport's address."""
    device = device_of(address)
    return (f"{NODE}:{system}", *([device] if device else []))


class StatusServer(Closing):
    """Serves requests in a separate thread, those of one peer at a time; `access` returns the answer to a request.

    A name that is too long or in use by another node is reported and not served.
    """

    def __init__(
        self,
        names: Sequence[str],
        access: Callable[[bytes], bytes],
        report: Callable[[str], None],
        parameters: Sequence[BlockParameter] = (),
    ) -> None:
        self._access = access
        self._parameters = parameters
        self._listeners = [item for name in names if (item := _listener(name, report))]
        self._stopped, self._stop = socket.socketpair()
        self._thread = threading.Thread(target=self._serve, name="status", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop serving. A second call does nothing."""
        with suppress(OSError):
            self._stop.send(b"\0")
        self._thread.join()
        for item in (*self._listeners, self._stop, self._stopped):
            item.close()

    def _serve(self) -> None:
        while self._stopped not in (ready := select.select([self._stopped, *self._listeners], [], [])[0]):
            peer, _ = ready[0].accept()
            with peer, suppress(OSError):
                if _user_of(peer) in (0, os.geteuid()):
                    self._answer(peer)

    def _answer(self, peer: socket.socket) -> None:
        """Answer a peer until it ends or is silent."""
        while select.select([self._stopped, peer], [], [], _SILENCE_SECONDS)[0] == [peer]:
            request = peer.recv(_LONGEST_PACKET)
            if not request:
                return
            reply = self._reply(request)
            # The server does not wait for a peer that does not read its replies.
            peer.send(reply, socket.MSG_DONTWAIT)

    def _reply(self, request: bytes) -> bytes:
        number = request.removeprefix(_PARAMETER)
        if number != request and number.isdigit():
            return _parameter_text(self._parameters[int(number) :])
        try:
            return self._access(request)
        except TransportError as error:
            return str(error).encode()[:_LONGEST_PACKET]


def _parameter_text(parameters: Sequence[BlockParameter]) -> bytes:
    """Return the first of the parameters as JSON."""
    if not parameters:
        return b"null"
    item, found = parameters[0], parameters[0].parameter
    return json.dumps([item.block, found.name, found.type.name, found.default, found.least, found.most]).encode()


class NodeTransport(Closing):
    """A transport that a node has, for the frames of the status only."""

    def __init__(self, peer: socket.socket) -> None:
        self._peer = peer

    def send(self, frame: bytes) -> None:
        """Send a request. May raise `TransportError`."""
        try:
            self._peer.send(frame)
        except OSError as error:
            raise TransportError(f"the node has ended: {error.strerror}") from None

    def receive(self, timeout: float | None = None) -> Burst | None:
        """Return the answer, or None after `timeout` seconds. May raise `TransportError`."""
        reply = self._reply(timeout)
        if reply is None:
            return None
        if answered(reply) is None:
            raise TransportError(reply.decode(errors="replace"))
        return Burst(reply)

    def parameters(self) -> Iterator[BlockParameter]:
        """Yield the parameters of the hardware that the node knows. May raise `TransportError`."""
        for number in count():
            self.send(_PARAMETER + str(number).encode())
            reply = self._reply(_SILENCE_SECONDS)
            try:
                found = json.loads(reply or b"null")
            except ValueError:
                # A node of an earlier version takes it for a request to the hardware.
                return
            if found is None:
                return
            block, name, type_, *values = found
            yield BlockParameter(number, block, Parameter(name, INTEGER_AND_FLOAT[type_], *values))

    def _reply(self, timeout: float | None) -> bytes | None:
        try:
            self._peer.settimeout(timeout)
            reply = self._peer.recv(_LONGEST_PACKET)
        except TimeoutError:
            return None
        except OSError as error:
            raise TransportError(f"the node has ended: {error.strerror}") from None
        if not reply:
            raise TransportError("the node has ended")
        return reply

    def is_ready(self) -> bool:
        """Return False, since the node's frames are unknown."""
        return False

    def is_at_rest(self) -> bool | None:
        """Return None, since the node's frames are unknown."""
        return None

    def close(self) -> None:
        """Close the connection to the node."""
        self._peer.close()


def open_status(address: str) -> Transport:
    """Return a transport for the status at an address: that of the node that uses it, or else a new one.

    `node:SYSTEM` is the running node of a system, `axi:UIO` a status with AXI4-Lite at a UIO device, and `udp:ADDRESS`
    a node in fabric. May raise `TransportError`.
    """
    if address.startswith(f"{AXI}:"):
        return open_registers_at(address)
    if address.startswith(f"{UDP}:"):
        return UdpStatus(address.removeprefix(f"{UDP}:"))
    is_node = address.startswith(f"{NODE}:")
    name = address if is_node else device_of(address)
    if name and (peer := _connected(name)):
        return NodeTransport(peer)
    if is_node:
        raise TransportError(
            f"no node of the system '{address.removeprefix(f'{NODE}:')}' with a status runs on this computer"
        )
    return open_transport(address)


def _listener(name: str, report: Callable[[str], None]) -> socket.socket | None:
    if len(name.encode()) > _LONGEST_NAME:
        report(f"'firm status {name}' cannot ask this node, since the name is longer than {_LONGEST_NAME} bytes")
        return None
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        listener.bind(_PREFIX + name.encode())
        listener.listen(_WAITING_PEERS)
    except OSError as error:
        listener.close()
        report(f"'firm status {name}' cannot ask this node: {error.strerror}")
        return None
    return listener


def _connected(name: str) -> socket.socket | None:
    """Return a connection to the node with this name, or None if it is missing."""
    peer = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        if len(name.encode()) <= _LONGEST_NAME:
            peer.connect(_PREFIX + name.encode())
            if os.geteuid() == 0 or _user_of(peer) in (0, os.geteuid()):
                return peer
    except ConnectionRefusedError:
        pass
    except OSError as error:
        peer.close()
        raise TransportError(f"the node cannot be asked: {error.strerror}") from None
    peer.close()
    return None


def _user_of(peer: socket.socket) -> int:
    """Return the number of the user to whom the other process belongs."""
    form = "3i"
    _, user, _ = struct.unpack(form, peer.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize(form)))
    return int(user)
