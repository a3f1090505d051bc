"""The transport over a serial line, against a board at the other end of a pseudo-terminal."""

from __future__ import annotations

import os
import pty
import random
import termios
import threading
import time
from collections.abc import Iterator

import pytest
from cobs import cobs

from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.node.transport.open_transport import open_transport
from fusesoc_firm.node.transport.transport import Burst, LostFrameError, Transport, TransportError
from fusesoc_firm.node.transport.uart import UartTransport
from tests.links import coded
from tests.seeds import seeded

SEED = seeded(20240722)


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
            data = board.read(len(coded(frame)))
            assert data == coded(frame)
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


def test_the_rest_of_a_frame_is_no_fault(board: Board, breaks: list[float]) -> None:
    """The board was in the middle of a frame when the line was opened."""
    with UartTransport(board.device, 115200) as transport:
        assert len(breaks) == 1
        board.write(coded(pack_frame(1, b"half"))[4:] + coded(pack_frame(1, b"whole")))
        assert transport.receive(60) == Burst(pack_frame(1, b"whole"))
        assert (transport.counts.good, transport.counts.broken) == (1, 0)


def test_a_frame_that_comes_in_pieces(board: Board, transport: Transport) -> None:
    frame = pack_frame(2, b"abc")
    data = coded(frame)
    board.write(data[:3])
    assert transport.receive(0.05) is None
    board.write(data[3:7])
    assert transport.receive(0.05) is None
    board.write(data[7:])
    assert transport.receive(60) == Burst(frame)


@pytest.mark.parametrize(
    "broken",
    [
        coded(pack_frame(1, b"abc"))[1:],
        coded(pack_frame(1, b"abc"))[:-2] + b"\0",
        coded(b"\1\4\0\0\0abc"),
        coded(b"\1\4\0\0\0abcde"),
        coded(b"\1\0"),
        cobs.encode(pack_frame(1, b"abc") + bytes(4)) + b"\0",
        b"\5\0",
        bytes(range(1, 256)) * 5 + b"\0",
    ],
)
def test_a_broken_frame_costs_itself_alone(board: Board, breaks: list[float], broken: bytes) -> None:
    with UartTransport(board.device, 115200, longest=1000) as transport:
        good = coded(pack_frame(1, b"whole"))
        board.write(good + b"\0" + broken + b"\0" + good)
        assert transport.receive(60) == Burst(pack_frame(1, b"whole"))
        with pytest.raises(LostFrameError, match="a frame from the board was broken on the line"):
            transport.receive(60)
        assert transport.receive(60) == Burst(pack_frame(1, b"whole"))
        assert (transport.counts.good, transport.counts.broken) == (2, 1)
        assert len(breaks) == 1


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
        ("telepathy:x", "the transport is 'telepathy:x'; legal: "),
    ],
)
def test_addresses_that_open_nothing(address: str, message: str) -> None:
    with pytest.raises(TransportError) as caught:
        open_transport(address)
    assert message in str(caught.value)
