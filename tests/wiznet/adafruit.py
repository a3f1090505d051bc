"""What Adafruit's driver needs to reach a chip that is not behind pins: the bus, the chip select, `micropython`."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any

from fusesoc_firm.fabric.wiznet.spi import Slave, exchange


class Bus:
    """A bus of CircuitPython (`busio.SPI`) with one slave."""

    def __init__(self, slave: Slave) -> None:
        self._slave = slave

    def try_lock(self) -> bool:
        """The bus is free."""
        return True

    def unlock(self) -> None:
        """Nobody else waits for the bus."""

    def configure(self, **_: object) -> None:
        """Clock and mode do not matter here."""

    def write(self, data: bytes | bytearray) -> None:
        """Bytes to the slave."""
        for byte in data:
            exchange(self._slave, byte)

    def readinto(self, data: bytearray) -> None:
        """Bytes from the slave."""
        data[:] = bytes(exchange(self._slave, 0) for _ in data)


class Select:
    """The chip select, active low (`digitalio.DigitalInOut`)."""

    def __init__(self, slave: Slave) -> None:
        self._slave = slave
        self._value = True

    def switch_to_output(self, value: bool = True) -> None:
        """The pin is an output."""
        self.value = value

    @property
    def value(self) -> bool:
        """The level of the pin."""
        return self._value

    @value.setter
    def value(self, level: bool) -> None:
        if self._value and not level:
            self._slave.select()
        elif level and not self._value:
            self._slave.deselect()
        self._value = bool(level)


def driver(slave: Slave) -> Any:
    """A driver that has found its chip and reset it. It has no DHCP."""
    micropython = sys.modules.setdefault("micropython", ModuleType("micropython"))
    micropython.const = lambda value: value  # type: ignore[attr-defined]
    from adafruit_wiznet5k.adafruit_wiznet5k import WIZNET5K

    WIZNET5K._sockets_reserved = []  # the class keeps it for all chips
    return WIZNET5K(Bus(slave), Select(slave), is_dhcp=False)
