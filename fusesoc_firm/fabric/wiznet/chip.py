"""A chip of WIZnet with TCP/IP, as its host sees it: eight TCP sockets with registers and buffers.

The sockets of the kernel play the chip's TCP. The model does not interpret the data. Facts are from the datasheets of
W5500 and W5200; their address maps and SPI frames are in `w5500.py` and `w5200.py`.

Unlike with the chip, an incoming connection is complete before the chip's socket leaves LISTEN, and CLOSE (without a
handshake) resets a connection at once instead of at the peer's next segment.
"""

from __future__ import annotations

import errno
import fcntl
import select
import socket
import struct
import time
from collections.abc import Callable, Iterator
from enum import IntEnum, IntFlag
from functools import partial

SOCKETS = 8
MEMORY = 16384  # bytes of all transmit buffers together, and of all receive buffers
_COUNT = 0x10000  # pointers of buffers and their differences are 16 bits
_SIOCOUTQ = 0x5411  # of Linux: bytes that the peer has not acknowledged
_SEGMENT = 1460
_TICK = 100e-6  # seconds: unit of RTR
_LONGEST_RETRY = 0xFFFF  # ticks


class Status(IntEnum):
    """Sn_SR, the state of a socket."""

    CLOSED = 0x00
    INIT = 0x13
    LISTEN = 0x14
    SYNSENT = 0x15
    SYNRECV = 0x16
    ESTABLISHED = 0x17
    FIN_WAIT = 0x18
    CLOSE_WAIT = 0x1C
    LAST_ACK = 0x1D


class Command(IntEnum):
    """Sn_CR, a host's command to a socket."""

    OPEN = 0x01
    LISTEN = 0x02
    CONNECT = 0x04
    DISCON = 0x08
    CLOSE = 0x10
    SEND = 0x20
    SEND_KEEP = 0x22
    RECV = 0x40


class Interrupt(IntFlag):
    """Sn_IR, the events of a socket since the host cleared their bits."""

    CON = 0x01
    DISCON = 0x02
    RECV = 0x04
    TIMEOUT = 0x08
    SENDOK = 0x10


# Addresses of a socket's registers, the same in both chips.
MODE, COMMAND, INTERRUPT, STATUS = range(4)
PORT, PEER_ADDRESS, PEER_PORT = 0x04, 0x0C, 0x10
RX_SIZE, TX_SIZE = 0x1E, 0x1F
TX_FREE, TX_READ, TX_WRITE = 0x20, 0x22, 0x24
RX_RECEIVED, RX_READ, RX_WRITE = 0x26, 0x28, 0x2A
KEEP_ALIVE = 0x2F
_REGISTERS = 0x30
_TCP = 0x01
_OPEN_STATES = {Status.SYNRECV, Status.ESTABLISHED, Status.FIN_WAIT, Status.CLOSE_WAIT, Status.LAST_ACK}
_SENDING_STATES = {Status.ESTABLISHED, Status.CLOSE_WAIT}


class ChipSocket:
    """A socket of the chip: its registers, its buffers, and its connection."""

    def __init__(self, number: int) -> None:
        self.number = number
        self.registers = bytearray(_REGISTERS)
        self.registers[RX_SIZE] = self.registers[TX_SIZE] = 2
        self.tx = bytearray(MEMORY)
        self.rx = bytearray(MEMORY)
        self.forget()

    def forget(self) -> None:
        """Return to CLOSED without a connection. Registers that the host wrote remain."""
        self.status = Status.CLOSED
        self.shown = Status.CLOSED  # when the host last read it
        self.interrupt = Interrupt(0)
        self.command = 0  # what a read of Sn_CR still returns
        self.connection: socket.socket | None = None
        self.tx_write = self.tx_sent = self.tx_commanded = self.tx_acknowledged = 0
        self.rx_write = self.rx_read = self.rx_freed = 0
        self.is_ending = self.has_sent_end = self.has_ended = False
        self.deadline = 0.0

    @property
    def port(self) -> int:
        """The port at this side."""
        return int.from_bytes(self.registers[PORT : PORT + 2], "big")

    @property
    def peer(self) -> tuple[str, int]:
        """Address and port of the other side, as the host has set them."""
        port = int.from_bytes(self.registers[PEER_PORT : PEER_PORT + 2], "big")
        return dotted(self.registers[PEER_ADDRESS : PEER_ADDRESS + 4]), port

    @property
    def tx_bytes(self) -> int:
        """Size of the transmit buffer."""
        return self.registers[TX_SIZE] * 1024

    @property
    def rx_bytes(self) -> int:
        """Size of the receive buffer."""
        return self.registers[RX_SIZE] * 1024

    def count(self, address: int) -> int | None:
        """The 16-bit count whose first byte has this address, or None."""
        counts: dict[int, Callable[[], int]] = {
            TX_FREE: lambda: self.tx_bytes - (self.tx_commanded - self.tx_acknowledged) % _COUNT,
            TX_READ: lambda: self.tx_acknowledged,
            TX_WRITE: lambda: self.tx_write,
            RX_RECEIVED: lambda: (self.rx_write - self.rx_freed) % _COUNT,
            RX_READ: lambda: self.rx_read,
            RX_WRITE: lambda: self.rx_write,
        }
        return counts[address]() if address in counts else None


class Chip:
    """The chip without its address map: common registers, sockets, and their behaviour over time.

    `misuses` lists the host's actions that the datasheets forbid; the chip's reaction is undefined.
    """

    def __init__(self, common: int, address: int, retry: int) -> None:
        """A chip after reset.

        `common` is its number of common registers, `address` that of SIPR, `retry` that of RTR, which RCR follows.
        """
        self.misuses: list[str] = []
        self.has_link = True
        self._common_bytes = common
        self._address = address
        self._retry = retry
        self._listeners: dict[int, socket.socket] = {}
        self.sockets: list[ChipSocket] = []
        self.reset()

    def reset(self) -> None:
        """Return to the state after power-up. Connections are cut."""
        for item in self.sockets:
            self._cut(item)
        self.common = bytearray(self._common_bytes)
        self.common[self._retry : self._retry + 3] = b"\x07\xd0\x08"  # 200 ms, 8 times
        self.sockets = [ChipSocket(number) for number in range(SOCKETS)]
        self._listen()

    def close(self) -> None:
        """Close all sockets of the kernel."""
        self.reset()

    # The functions that the address maps call.

    def read_socket(self, number: int, address: int) -> int:
        """A byte of a socket's registers, or 0 without a register."""
        item = self.sockets[number]
        if address == COMMAND:
            value, item.command = item.command, 0
            return value
        if address == INTERRUPT:
            return item.interrupt
        if address == STATUS:
            item.shown = item.status
            return item.status
        if address & 1:
            self.poll()  # the chip does not hold a count while its bytes are read
        count = item.count(address & ~1)
        if count is None:
            return item.registers[address] if address < _REGISTERS else 0
        return count & 0xFF if address & 1 else count >> 8

    def write_socket(self, number: int, address: int, value: int) -> None:
        """Write a byte of a socket's registers, except read-only ones."""
        item = self.sockets[number]
        if address == COMMAND:
            self._execute(item, value)
        elif address == INTERRUPT:
            item.interrupt &= ~Interrupt(value & 0x1F)
        elif address & ~1 == TX_WRITE:
            item.tx_write = _with_byte(item.tx_write, address, value)
        elif address & ~1 == RX_READ:
            item.rx_read = _with_byte(item.rx_read, address, value)
        elif address < _REGISTERS and item.count(address & ~1) is None and address != STATUS:
            item.registers[address] = value

    def interrupts(self) -> int:
        """A bit for each socket with an interrupt."""
        return sum(1 << item.number for item in self.sockets if item.interrupt)

    # Time.

    def poll(self, seconds: float = 0) -> None:
        """Process the events on the network; wait up to `seconds` for one."""
        if seconds:
            self._wait(seconds)
        for item in self.sockets:
            if item.status == Status.SYNRECV:
                item.status = Status.ESTABLISHED
                item.interrupt |= Interrupt.CON
            elif item.status == Status.LISTEN:
                self._accept(item)
            elif item.status == Status.SYNSENT:
                self._finish_connecting(item)
            if item.status in _OPEN_STATES:
                self._guarded(item, self._transfer)

    def _wait(self, seconds: float) -> None:
        readers, writers = [*self._listeners.values()], []
        for item in self.sockets:
            if item.connection and item.status != Status.SYNSENT and _room(item):
                readers.append(item.connection)
            if item.connection and (item.status == Status.SYNSENT or item.tx_sent != item.tx_commanded):
                writers.append(item.connection)
        select.select(readers, writers, [], seconds)

    # Commands.

    def _execute(self, item: ChipSocket, value: int) -> None:
        commands: dict[int, Callable[[ChipSocket], None]] = {
            Command.OPEN: self._open,
            Command.LISTEN: self._start_listening,
            Command.CONNECT: self._connect,
            Command.DISCON: self._disconnect,
            Command.CLOSE: self._cut,
            Command.SEND: self._send,
            Command.SEND_KEEP: self._send_keep,
            Command.RECV: self._receive,
        }
        if item.command:
            self._misuse(item, f"command {value:#x} before {item.command:#x} was taken")
        if value not in commands:
            self._misuse(item, f"command {value:#x}, which TCP does not have")
            return
        commands[value](item)
        item.command = value

    def _open(self, item: ChipSocket) -> None:
        self._cut(item)
        if item.registers[MODE] & 0x0F != _TCP:
            self._misuse(item, f"mode {item.registers[MODE]:#x}; this model has TCP only")
        elif sum(other.tx_bytes for other in self.sockets) > MEMORY or item.tx_bytes == 0:
            self._misuse(item, "transmit buffers of more than 16 KiB, or of none")
        elif sum(other.rx_bytes for other in self.sockets) > MEMORY or item.rx_bytes == 0:
            self._misuse(item, "receive buffers of more than 16 KiB, or of none")
        else:
            item.status = Status.INIT

    def _start_listening(self, item: ChipSocket) -> None:
        if item.status != Status.INIT:
            self._misuse(item, "LISTEN outside INIT")
            return
        item.status = Status.LISTEN
        self._listen()

    def _connect(self, item: ChipSocket) -> None:
        if item.status != Status.INIT:
            self._misuse(item, "CONNECT outside INIT")
            return
        item.connection = _kernel_socket()
        item.status = Status.SYNSENT
        item.deadline = time.monotonic() + self._tcp_seconds()
        self._guarded(item, self._start_connecting)

    def _start_connecting(self, item: ChipSocket) -> None:
        assert item.connection
        item.connection.bind((self.address, item.port))
        error = item.connection.connect_ex(item.peer)
        if error not in {0, errno.EINPROGRESS}:
            raise OSError(error, errno.errorcode[error])

    def _disconnect(self, item: ChipSocket) -> None:
        if item.status not in _SENDING_STATES:
            self._cut(item)
            return
        if item.tx_acknowledged != item.tx_commanded:
            self._misuse(item, "DISCON before SENDOK")
        item.status = Status.FIN_WAIT if item.status == Status.ESTABLISHED else Status.LAST_ACK
        item.is_ending = True
        self._guarded(item, self._transfer)

    def _send(self, item: ChipSocket) -> None:
        if item.status not in _SENDING_STATES:
            self._misuse_without_connection(item, "SEND")
        elif (item.tx_write - item.tx_acknowledged) % _COUNT > item.tx_bytes:
            self._misuse(item, "SEND of more bytes than are free")
        else:
            item.tx_commanded = item.tx_write
            self._guarded(item, self._transfer)

    def _send_keep(self, item: ChipSocket) -> None:
        """Send a keep-alive. The kernel repeats it each second, and gives up as the chip does."""
        if item.status not in _SENDING_STATES:
            self._misuse_without_connection(item, "SEND_KEEP")
        elif item.registers[KEEP_ALIVE]:
            self._misuse(item, "SEND_KEEP beside KPALVTR")
        else:
            self._guarded(item, partial(_keep_alive, seconds=1))

    def _receive(self, item: ChipSocket) -> None:
        if (item.rx_read - item.rx_freed) % _COUNT > (item.rx_write - item.rx_freed) % _COUNT:
            self._misuse(item, "RECV of more bytes than were received")
            return
        item.rx_freed = item.rx_read
        # The interrupt comes again while bytes remain.
        if item.rx_freed != item.rx_write:
            item.interrupt |= Interrupt.RECV

    def _misuse_without_connection(self, item: ChipSocket, what: str) -> None:
        """Record a misused command, unless the connection ended after the host last read the status."""
        if item.shown not in _SENDING_STATES:
            self._misuse(item, f"{what} without a connection")

    def _misuse(self, item: ChipSocket, what: str) -> None:
        self.misuses.append(f"socket {item.number} in {item.status.name}: {what}")

    # Connections.

    @property
    def address(self) -> str:
        """SIPR, the chip's own address."""
        return dotted(self.common[self._address : self._address + 4])

    def _tcp_seconds(self) -> float:
        """The time after which TCP gives up: RTR doubles with each of RCR retries (datasheet, RCR)."""
        ticks = int.from_bytes(self.common[self._retry : self._retry + 2], "big")
        retries = self.common[self._retry + 2]
        return sum(min(ticks << number, _LONGEST_RETRY) for number in range(retries + 1)) * _TICK

    def _listen(self) -> None:
        """Listen at the ports of the sockets in LISTEN. At others, the kernel answers with RST, as the chip does."""
        wanted: dict[int, int] = {}
        for item in self.sockets:
            if item.status == Status.LISTEN:
                wanted[item.port] = wanted.get(item.port, 0) + 1
        for port in [*self._listeners]:
            if port not in wanted:
                self._listeners.pop(port).close()
        for port, sockets in wanted.items():
            if port not in self._listeners:
                self._listeners[port] = _kernel_socket()
                self._listeners[port].bind((self.address, port))
            self._listeners[port].listen(sockets - 1)  # the kernel's queue has one place more

    def _accept(self, item: ChipSocket) -> None:
        try:
            item.connection, (address, port) = self._listeners[item.port].accept()
        except (BlockingIOError, ConnectionAbortedError):
            return
        self._set_up(item)
        item.registers[PEER_ADDRESS : PEER_ADDRESS + 4] = socket.inet_aton(address)
        item.registers[PEER_PORT : PEER_PORT + 2] = port.to_bytes(2, "big")
        item.status = Status.SYNRECV
        self._listen()

    def _finish_connecting(self, item: ChipSocket) -> None:
        assert item.connection
        if select.select([], [item.connection], [], 0)[1]:
            self._guarded(item, self._established)
        elif time.monotonic() > item.deadline:
            self._end(item, Interrupt.TIMEOUT)

    def _established(self, item: ChipSocket) -> None:
        _raise_error(item)
        self._set_up(item)
        item.status = Status.ESTABLISHED
        item.interrupt |= Interrupt.CON

    def _set_up(self, item: ChipSocket) -> None:
        assert item.connection
        item.connection.setblocking(False)
        options = [(socket.TCP_NODELAY, 1), (socket.TCP_USER_TIMEOUT, int(self._tcp_seconds() * 1000))]
        for option, value in options:
            item.connection.setsockopt(socket.IPPROTO_TCP, option, value)
        if seconds := 5 * item.registers[KEEP_ALIVE]:
            _keep_alive(item, seconds)

    def _transfer(self, item: ChipSocket) -> None:
        if item.has_ended:
            _raise_error(item)  # without further reception, a reset would remain unnoticed
        self._transmit(item)
        for data in _received(item):
            for byte in data:
                item.rx[item.rx_write % item.rx_bytes] = byte
                item.rx_write = (item.rx_write + 1) % _COUNT
            item.interrupt |= Interrupt.RECV
        if item.has_ended and item.status == Status.ESTABLISHED:
            item.status = Status.CLOSE_WAIT
            item.interrupt |= Interrupt.DISCON
        is_over = item.status == Status.LAST_ACK or (item.has_ended and item.status == Status.FIN_WAIT)
        if is_over and _unacknowledged(item) == 0:
            self._end(item, Interrupt.DISCON)

    def _transmit(self, item: ChipSocket) -> None:
        assert item.connection
        if item.tx_sent != item.tx_commanded:
            start = item.tx_sent % item.tx_bytes
            length = min((item.tx_commanded - item.tx_sent) % _COUNT, item.tx_bytes - start)
            try:
                sent = item.connection.send(item.tx[start : start + length])
            except BlockingIOError:
                sent = 0
            item.tx_sent = (item.tx_sent + sent) % _COUNT
        before = item.tx_acknowledged
        item.tx_acknowledged = (item.tx_sent - _unacknowledged_bytes(item)) % _COUNT
        if item.tx_acknowledged == item.tx_commanded != before:
            item.interrupt |= Interrupt.SENDOK
        if item.is_ending and item.tx_sent == item.tx_commanded:
            item.is_ending, item.has_sent_end = False, True
            item.connection.shutdown(socket.SHUT_WR)

    def _guarded(self, item: ChipSocket, action: Callable[[ChipSocket], None]) -> None:
        """Apply `action` to a connection. If the connection ends, close its socket."""
        try:
            action(item)
        except OSError as error:
            is_silent = error.errno in {errno.ETIMEDOUT, errno.EHOSTUNREACH, errno.ENETUNREACH}
            self._end(item, Interrupt.TIMEOUT if is_silent else Interrupt.DISCON)

    def _end(self, item: ChipSocket, interrupt: Interrupt) -> None:
        """A connection has ended. What was received can still be read."""
        if item.connection:
            item.connection.close()
        item.connection = None
        item.status = Status.CLOSED
        item.interrupt |= interrupt

    def _cut(self, item: ChipSocket) -> None:
        """End a connection without telling the peer; its next segment is answered with RST."""
        if item.connection:
            item.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            item.connection.close()
        item.forget()
        self._listen()


def dotted(address: bytes | bytearray) -> str:
    """An IPv4 address as text."""
    return socket.inet_ntoa(bytes(address))


def _with_byte(count: int, address: int, value: int) -> int:
    """A count of which one byte is written, the higher one at even addresses."""
    return count & 0xFF00 | value if address & 1 else count & 0x00FF | value << 8


def _kernel_socket() -> socket.socket:
    made = socket.socket()
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    made.setblocking(False)
    return made


def _raise_error(item: ChipSocket) -> None:
    """Raise the `OSError` that a connection has, if any."""
    assert item.connection
    if error := item.connection.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
        raise OSError(error, errno.errorcode[error])


def _keep_alive(item: ChipSocket, seconds: int) -> None:
    """Send a keep-alive whenever the peer has been silent for this time."""
    assert item.connection
    item.connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for option in (socket.TCP_KEEPIDLE, socket.TCP_KEEPINTVL):
        item.connection.setsockopt(socket.IPPROTO_TCP, option, seconds)


def _unacknowledged(item: ChipSocket) -> int:
    """Bytes, and the FIN, that the peer has not acknowledged."""
    assert item.connection
    answer = fcntl.ioctl(item.connection, _SIOCOUTQ, struct.pack("i", 0))
    return int(struct.unpack("i", answer)[0])


def _unacknowledged_bytes(item: ChipSocket) -> int:
    """Bytes of data that the peer has not acknowledged; the kernel counts a FIN in transit as one."""
    return max(_unacknowledged(item) - item.has_sent_end, 0)


def _room(item: ChipSocket) -> int:
    """Free bytes of the receive buffer; none after the peer's end."""
    return 0 if item.has_ended else item.rx_bytes - (item.rx_write - item.rx_freed) % _COUNT


def _received(item: ChipSocket) -> Iterator[bytes]:
    """The received data that fit into the buffer, in segments."""
    assert item.connection
    while room := _room(item):
        try:
            data = item.connection.recv(min(room, _SEGMENT))
        except BlockingIOError:
            return
        if not data:
            item.has_ended = True
            return
        yield data
