"""The SPI slave of a chip, byte by byte: each byte from the host is exchanged for one to the host."""

from __future__ import annotations

from typing import Protocol


class Slave(Protocol):
    """What a chip is for its host. A frame begins at `select` and ends at `deselect`."""

    def select(self) -> None:
        """The chip select becomes active."""

    def exchange(self, byte: int) -> int:
        """The byte from the chip while one comes from the host."""

    def deselect(self) -> None:
        """The chip select becomes inactive."""


def transfer(slave: Slave, sent: bytes) -> bytes:
    """One frame. What the chip answers, as long as what is sent."""
    slave.select()
    answer = bytes(slave.exchange(byte) for byte in sent)
    slave.deselect()
    return answer
