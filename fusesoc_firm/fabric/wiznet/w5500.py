"""W5500: blocks of registers and buffers, selected by the third byte of each SPI frame.

A frame: address (2 bytes), block (5 bits), write (1 bit), mode (2 bits: any length, or 1, 2 or 4 bytes), data.
"""

from __future__ import annotations

from fusesoc_firm.fabric.wiznet.chip import Chip

_ADDRESS, _RETRY = 0x0F, 0x19
_INTERRUPTS, _PHY, _VERSION = 0x17, 0x2E, 0x39
_LINK_DOWN, _LINK_UP = 0xB8, 0xBF
_COMMON = 0x40
_FIXED_LENGTHS = {1: 1, 2: 2, 3: 4}
_HEADER = 3


class W5500(Chip):
    """The chip with its SPI slave."""

    def __init__(self) -> None:
        super().__init__(_COMMON, _ADDRESS, _RETRY)
        self._header = bytearray()
        self._left: int | None = None

    def select(self) -> None:
        """Begin a frame."""
        self.poll()
        self._header.clear()

    def deselect(self) -> None:
        """End a frame. A frame of fixed length that ends early is a misuse."""
        if len(self._header) == _HEADER and self._left:
            self.misuses.append(f"a frame of fixed length ends {self._left} bytes early")

    def answer(self) -> int:
        """The byte at the current address, or 0."""
        if len(self._header) < _HEADER or self._header[2] & 4 or self._left == 0:
            return 0
        return self._read(self._header[2] >> 3, self._position)

    def take(self, byte: int) -> None:
        """A byte of the header, or one to write; the address advances."""
        if len(self._header) < _HEADER:
            self._header.append(byte)
            if len(self._header) == _HEADER:
                self._position = int.from_bytes(self._header[:2], "big")
                self._left = _FIXED_LENGTHS.get(byte & 3)
            return
        if self._left == 0:
            self.misuses.append("a frame of fixed length goes on")
            return
        if self._header[2] & 4:
            self._write(self._header[2] >> 3, self._position, byte)
        self._position = (self._position + 1) & 0xFFFF
        if self._left is not None:
            self._left -= 1

    def _read(self, block: int, address: int) -> int:
        if block == 0:
            phy = _LINK_UP if self.has_link else _LINK_DOWN
            own = {_INTERRUPTS: self.interrupts(), _PHY: phy, _VERSION: 4}
            return own[address] if address in own else self.common[address] if address < _COMMON else 0
        item = self.sockets[block >> 2]
        match block & 3:
            case 1:
                return self.read_socket(item.number, address)
            case 2 if item.tx_bytes:
                return item.tx[address % item.tx_bytes]
            case 3 if item.rx_bytes:
                return item.rx[address % item.rx_bytes]
        return 0

    def _write(self, block: int, address: int, value: int) -> None:
        if block == 0:
            if address == 0 and value & 0x80:
                self.reset()
            elif address < _COMMON:
                self.common[address] = value
            return
        item = self.sockets[block >> 2]
        match block & 3:
            case 1:
                self.write_socket(item.number, address, value)
            case 2 if item.tx_bytes:
                item.tx[address % item.tx_bytes] = value
            case _:
                self.misuses.append(f"a write to block {block}")
