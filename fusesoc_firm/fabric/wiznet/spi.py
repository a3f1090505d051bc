"""The SPI slave of a chip, byte by byte: each byte from the host is exchanged for one to the host."""

from __future__ import annotations

from typing import Protocol


class Slave(Protocol):
    """A chip as its host sees it. A frame begins with `select` and ends with `deselect`."""

    def select(self) -> None:
        """The chip select becomes active."""

    def answer(self) -> int:
        """The byte for the host, which the chip sends during the host's next byte."""

    def take(self, byte: int) -> None:
        """Receive a byte from the host."""

    def deselect(self) -> None:
        """The chip select becomes inactive."""


def exchange(slave: Slave, byte: int) -> int:
    """Send a byte to the chip, and return the received one."""
    answer = slave.answer()
    slave.take(byte)
    return answer
