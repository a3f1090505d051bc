"""The line between an emulator and the pins, with a program that sends before it takes an answer."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.node.transport.simulator import Taken
from fusesoc_firm.node.transport.transport import Burst
from fusesoc_firm.runs.emulation.line import Line

BYTES = 600_000


class Echo:
    """A simulator whose system sends back what it takes."""

    quiet = 0

    def __init__(self) -> None:
        self._requests: list[bytes] = []

    def request(self, data: bytes) -> None:
        self._requests.append(data)

    def run(self, _cycles: int) -> Iterator[Any]:
        for data in self._requests:
            yield Taken(0, 0)
            yield Burst(data)
        self._requests.clear()

    def close(self) -> None:
        """End nothing."""


@pytest.fixture
def line(tmp_path: Path) -> Iterator[socket.socket]:
    simulator: Any = Echo()
    with Line(simulator, tmp_path / "line"), socket.socket(socket.AF_UNIX) as emulator:
        emulator.connect(str(tmp_path / "line"))
        yield emulator


def test_a_program_may_send_all_before_it_takes_an_answer(line: socket.socket) -> None:
    """Both sockets are full in the meantime."""
    sent = bytes(number % 251 for number in range(BYTES))
    line.sendall(sent)
    received = b""
    while len(received) < BYTES:
        received += line.recv(1 << 16)
    assert received == sent
