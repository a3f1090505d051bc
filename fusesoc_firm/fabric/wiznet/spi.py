"""The SPI slave of a chip, byte by byte: each byte from the host is exchanged for one to the host."""

from __future__ import annotations

from typing import Protocol


class Slave(Protocol):
    """What a chip is for its host. A frame begins with `select` and ends with `deselect`."""

    def select(self) -> None:
        """The chip select becomes active."""

    def answer(self) -> int:
        """The byte for the host, which the chip sends while the host's next one is on its way."""

    def take(self, byte: int) -> None:
        """A byte of the host has come."""

    def deselect(self) -> None:
        """The chip select becomes inactive."""


def exchange(slave: Slave, byte: int) -> int:
    """A byte to the chip, and the one that comes back."""
    answer = slave.answer()
    slave.take(byte)
    return answer
