"""The transport over a serial line, against a board at the other end of a pseudo-terminal."""

from __future__ import annotations

import os
import pty
import random
import select
import termios
import threading
import time
from collections.abc import Iterator

import pytest

from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.node.transport import uart
from fusesoc_firm.node.transport.open_transport import open_transport
from fusesoc_firm.node.transport.transport import Burst, Transport, TransportError, TransportResetError
from fusesoc_firm.node.transport.uart import UartTransport

SEED = 20240722


class Board:
    """The other end of the line; what it gets is to be read with `read`."""

    def __init__(self) -> None:
        self.end, line = pty.openpty()
        self.device = os.ttyname(line)
        self._line = line
        self._is_closed = False

    def read(self, size: int) -> bytes:
        data = b""
        while len(data) < size:
            data += os.read(self.end, size - len(data))
        return data

    def write(self, data: bytes) -> None:
        while data:
            data = data[os.write(self.end, data) :]

    def close(self) -> None:
        if not self._is_closed:
            os.close(self.end)
            os.close(self._line)
        self._is_closed = True


@pytest.fixture
def breaks(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """When breaks were sent; a pseudo-terminal hands none on."""
    found: list[float] = []
    monkeypatch.setattr(termios, "tcsendbreak", lambda _line, _duration: found.append(time.monotonic()))
    return found


@pytest.fixture
def board() -> Iterator[Board]:
    made = Board()
    yield made
    made.close()


@pytest.fixture
def transport(board: Board, breaks: list[float]) -> Iterator[Transport]:
    with open_transport(f"uart:{board.device}:115200") as opened:
        assert len(breaks) == 1
        yield opened


def test_frames_of_all_bytes_there_and_back(board: Board, transport: Transport) -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED)
    payloads = [bytes(range(256)), b"", *(source.randbytes(source.randrange(3000)) for _ in range(30))]
    frames = [pack_frame(number % 4, payload) for number, payload in enumerate(payloads)]

    def echo() -> None:
        for frame in frames:
            data = board.read(len(frame))
            for first in range(0, len(data), 700):
                board.write(data[first : first + 700])

    thread = threading.Thread(target=echo)
    thread.start()

    def send() -> None:
        for frame in frames:
            transport.send(frame)

    sender = threading.Thread(target=send)
    sender.start()
    assert [transport.receive(60) for _ in frames] == [Burst(frame) for frame in frames]
    sender.join()
    thread.join()
    assert transport.receive(0.01) is None


def test_what_came_before_it_was_opened_is_dropped(board: Board, breaks: list[float]) -> None:
    board.write(b"\x00\x05\x00\x00\x00half")
    with UartTransport(board.device, 115200) as transport:
        assert len(breaks) == 1
        board.write(pack_frame(1, b"whole"))
        assert transport.receive(60) == Burst(pack_frame(1, b"whole"))


def test_a_frame_that_comes_in_pieces(board: Board, transport: Transport, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uart, "_LONGEST_PAUSE_SECONDS", 5.0)
    frame = pack_frame(2, b"abc")
    board.write(frame[:3])
    assert transport.receive(0.05) is None
    board.write(frame[3:7])
    assert transport.receive(0.05) is None
    board.write(frame[7:])
    assert transport.receive(60) == Burst(frame)


@pytest.mark.parametrize(
    ("sent", "why"),
    [
        (b"\x00\xff\xff\xff\xff\x00", "announces 4294967295 bytes"),
        (b"\x00\x09\x00\x00\x00abc", "a frame is incomplete"),
    ],
)
def test_what_cannot_be_a_frame_makes_a_break(
    board: Board, transport: Transport, breaks: list[float], sent: bytes, why: str
) -> None:
    board.write(sent)
    with pytest.raises(TransportResetError, match=why):
        transport.receive(60)
    assert len(breaks) == 2
    board.write(pack_frame(1, b"whole"))
    assert transport.receive(60) == Burst(pack_frame(1, b"whole"))


def test_a_break_ends_the_frame_that_is_held(board: Board, transport: Transport) -> None:
    refusals: list[str] = []

    def send() -> None:
        try:
            # More than the line takes while nobody reads.
            transport.send(pack_frame(0, bytes(100_000)))
        except TransportResetError as error:
            refusals.append(str(error))

    sender = threading.Thread(target=send)
    sender.start()
    # It has begun.
    select.select([board.end], [], [])
    board.write(b"\x00\x09\x00\x00\x00abc")
    # A receiver that waits for a short time only finds it, too.
    assert transport.receive(0.01) is None
    time.sleep(0.3)
    with pytest.raises(TransportResetError, match="a frame is incomplete"):
        transport.receive(0.01)
    sender.join()
    assert refusals == [f"{board.device}: a break interrupted a frame"]


def test_a_line_that_is_never_silent(board: Board, breaks: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uart, "_MOST_SILENCE_SECONDS", 0.2)
    # However busy the machine is, the chatter has no such pause.
    monkeypatch.setattr(uart, "_SILENT_SECONDS", 2.0)
    is_over = threading.Event()

    def chatter() -> None:
        while not is_over.wait(0.005):
            board.write(b"x")

    thread = threading.Thread(target=chatter)
    thread.start()
    try:
        with pytest.raises(TransportError, match="is never silent"):
            UartTransport(board.device, 115200)
    finally:
        is_over.set()
        thread.join()


def test_closing_wakes_who_waits(board: Board, transport: Transport) -> None:
    found: list[Burst | None] = []
    refusals: list[str] = []
    receiver = threading.Thread(target=lambda: found.append(transport.receive()))
    receiver.start()

    def flood() -> None:
        try:
            while True:
                transport.send(bytes(5000))
        except TransportError as error:
            refusals.append(str(error))

    sender = threading.Thread(target=flood)
    sender.start()
    time.sleep(0.2)
    transport.close()
    receiver.join()
    sender.join()
    assert found == [None]
    assert refusals == ["the transport is closed"]
    transport.close()
    with pytest.raises(TransportError, match="the transport is closed"):
        transport.send(b"x")


def test_a_board_that_goes(board: Board, transport: Transport) -> None:
    board.close()
    with pytest.raises(TransportError, match=r"/dev/pts/\d+ is lost"):
        transport.receive(60)


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("uart:/dev/none:115200", "cannot open the serial line /dev/none: No such file"),
        ("uart:/dev/null:115200", "/dev/null is not a serial line"),
        ("uart:/dev/null:123", "123 is not a legal baud rate"),
        ("uart:/dev/null:fast", "the baud rate is 'fast', which is not a number"),
        ("uart:/dev/null", "the transport is 'uart:/dev/null'; legal: pipe:COMMAND, uart:"),
        ("pipe:", "the transport is 'pipe:'; legal: pipe:COMMAND"),
        ("pipe:'a", "whose command is invalid: No closing quotation"),
        ("telepathy:x", "the transport is 'telepathy:x'; legal: "),
    ],
)
def test_addresses_that_open_nothing(address: str, message: str) -> None:
    with pytest.raises(TransportError) as caught:
        open_transport(address)
    assert message in str(caught.value)
