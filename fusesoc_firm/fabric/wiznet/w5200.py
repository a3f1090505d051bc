"""W5200: one address space for registers and buffers.

A frame: address (2 bytes), write (1 bit), length (15 bits), data. The sockets' buffers are adjacent, and an address
does not wrap at the end of a buffer: the host splits a transfer that crosses it.
"""

from __future__ import annotations

from fusesoc_firm.fabric.wiznet.chip import Chip, ChipSocket

_ADDRESS, _RETRY = 0x0F, 0x17
_VERSION, _INTERRUPTS, _PHY = 0x1F, 0x34, 0x35
_LINK_DOWN, _LINK_UP = 0x00, 0x20
_COMMON = 0x37
_SOCKETS, _TX, _RX = 0x4000, 0x8000, 0xC000
_HEADER = 4


class W5200(Chip):
    """The chip with its SPI slave."""

    def __init__(self) -> None:
        super().__init__(_COMMON, _ADDRESS, _RETRY)
        self._header = bytearray()
        self._left = 0

    def select(self) -> None:
        """Begin a frame."""
        self.poll()
        self._header.clear()

    def deselect(self) -> None:
        """End a frame. A frame shorter than its length is a misuse."""
        if len(self._header) == _HEADER and self._left:
            self.misuses.append(f"a frame ends {self._left} bytes early")

    def answer(self) -> int:
        """The byte at the current address, or 0."""
        return 0 if len(self._header) < _HEADER or self._header[2] & 0x80 else self._read(self._position)

    def take(self, byte: int) -> None:
        """A byte of the header, or one to write; the address advances. A further header follows the last byte."""
        if len(self._header) < _HEADER:
            self._header.append(byte)
            if len(self._header) == _HEADER:
                self._position = int.from_bytes(self._header[:2], "big")
                self._left = int.from_bytes(self._header[2:], "big") & 0x7FFF
            return
        if self._header[2] & 0x80:
            self._write(self._position, byte)
        self._position = (self._position + 1) & 0xFFFF
        self._left -= 1
        if self._left == 0:
            self._header.clear()

    def _read(self, address: int) -> int:
        if address < _SOCKETS:
            own = {_VERSION: 3, _INTERRUPTS: self.interrupts(), _PHY: _LINK_UP if self.has_link else _LINK_DOWN}
            return own[address] if address in own else self.common[address] if address < _COMMON else 0
        if address < _TX:
            return self.read_socket(address >> 8 & 7, address & 0xFF)
        item, offset = self._place(address)
        return (item.tx if address < _RX else item.rx)[offset] if item else 0

    def _write(self, address: int, value: int) -> None:
        if address == 0 and value & 0x80:
            self.reset()
        elif address < _COMMON:
            self.common[address] = value
        elif _SOCKETS <= address < _TX:
            self.write_socket(address >> 8 & 7, address & 0xFF, value)
        else:
            item, offset = self._place(address)
            if item and _TX <= address < _RX:
                item.tx[offset] = value
            else:
                self.misuses.append(f"a write to address {address:#06x}")

    def _place(self, address: int) -> tuple[ChipSocket | None, int]:
        """The socket whose buffer has this address, and the place in the buffer."""
        offset = address & 0x3FFF
        for item in self.sockets:
            size = item.tx_bytes if address < _RX else item.rx_bytes
            if offset < size:
                return item, offset
            offset -= size
        return None, 0
