"""A simulated board by Ethernet: its PHY on one side, a TAP device of the kernel on the other.

A simulator with `firm_sim_phy` (cores/sim) exchanges frames through a pipe.
"""

from __future__ import annotations

import errno
import fcntl
import os
import select
import socket
import struct
import zlib
from collections.abc import Callable, Sequence
from ipaddress import IPv4Address
from pathlib import Path

from fusesoc_firm.fabric.simulated_board import SimulatedBoard
from fusesoc_firm.text.diagnostics import fail

_DEVICE = "/dev/net/tun"
# Of linux/sockios.h and linux/if.h: the request for a device's flags, and the flag of a device that is up.
_SIOCGIFFLAGS, _IFF_UP = 0x8913, 1
# Of linux/if_tun.h: the request, and the flags for frames without an additional header.
_TUNSETIFF, _IFF_TAP, _IFF_NO_PI = 0x400454CA, 0x0002, 0x1000
_LONGEST_NAME = 15
_NO_ROOM = (errno.EAGAIN, errno.ENOBUFS, errno.ENOMEM)
_PREAMBLE = b"\x55" * 7 + b"\xd5"
_SHORTEST, _FCS_BYTES = 60, 4
# The Ethernet type and the beginning of an ARP request; the offsets of addresses in its frame.
_ARP_REQUEST = bytes.fromhex("0806 0001 0800 06 04 0001")
_TYPE_IPV4, _DHCP_PORTS = b"\x08\x00", b"\0\x44\0\x43"
_SENDER_PLACE, _TARGET_PLACE, _ADDRESS_BYTES = 28, 38, 4
# Frames at a device with a larger MTU than Ethernet's are longer.
_MOST_BYTES = 2048
_CYCLES_BYTES, _SIZE_BYTES = 4, 2


class Tap:
    """A TAP device, at which frames of this machine arrive."""

    def __init__(self, name: str) -> None:
        """Open the device. Raise `InputError` if it is missing, not up, or inaccessible to this user."""
        self.name = name
        if not name or len(name) > _LONGEST_NAME or "/" in name:
            fail(f"'{name}' is not the name of a network device", hint=f"legal: up to {_LONGEST_NAME} characters")
        if not _is_up(name):
            fail(f"the network device '{name}' is not up", hint=f"'sudo ip link set {name} up' changes that")
        self._file = -1
        try:
            self._file = os.open(_DEVICE, os.O_RDWR | os.O_NONBLOCK)
            fcntl.ioctl(self._file, _TUNSETIFF, struct.pack("16sH22x", name.encode(), _IFF_TAP | _IFF_NO_PI))
        except OSError as error:
            self.close()
            reason = "it is not a TAP device" if error.errno == errno.EINVAL else error.strerror
            fail(f"cannot open the network device '{name}': {reason}", hint=_how_to_make(name))

    def read(self, seconds: float) -> bytes:
        """Return a frame that arrives within a time, or no bytes. Raise `InputError` if the device has failed.

        A frame that is too long is dropped, as by a network interface.
        """
        if not select.select([self._file], [], [], seconds)[0]:
            return b""
        try:
            frame = os.read(self._file, _MOST_BYTES + 1)
        except BlockingIOError:
            return b""
        except OSError as error:
            fail(f"the network device '{self.name}' does not give a frame: {error.strerror}")
        return frame if len(frame) <= _MOST_BYTES else b""

    def write(self, frame: bytes) -> None:
        """Send a frame; it is lost if the device has no room. Raise `InputError` if the device has failed."""
        try:
            os.write(self._file, frame)
        except OSError as error:
            if error.errno in _NO_ROOM:
                return
            fail(f"the network device '{self.name}' does not take a frame: {error.strerror}")

    def close(self) -> None:
        """Close the device. A second call does nothing."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1


def _is_up(name: str) -> bool:
    """Return whether a network device is up. Raise `InputError` if it is missing."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            answer = fcntl.ioctl(probe, _SIOCGIFFLAGS, struct.pack("16sH22x", name.encode(), 0))
        except OSError:
            fail(f"there is no network device '{name}'", hint=_how_to_make(name))
    flags: int = struct.unpack_from("16xH", answer)[0]
    return bool(flags & _IFF_UP)


def _how_to_make(name: str) -> str:
    return f"'sudo ip tuntap add dev {name} mode tap user $USER' and 'sudo ip link set {name} up' make one"


class Board(SimulatedBoard):
    """A running board at a TAP device.

    `on_address` is called with each new address that the board announces by ARP, and with "" when the board has lost
    its address and requests another one by DHCP.
    """

    def __init__(self, command: Sequence[str], folder: Path, tap: Tap, hertz: int) -> None:
        """Start the simulator `command` in `folder`; its clock has `hertz`. Raise `OSError` if that is impossible."""
        super().__init__(command, folder, hertz)
        self._tap, self._sent = tap, bytearray()
        self._address = ""
        self.on_address: Callable[[str], None] = lambda address: None

    def run(self, is_over: Callable[[], bool] = lambda: False) -> None:
        """Exchange frames until the condition holds. Raise `InputError` if the simulator ends."""
        while not is_over():
            report = self.read(1)
            if report == b"b":
                self._sent += self.read(1)
            elif report == b"e":
                self._send()
            elif report == b"w":
                self._receive(int.from_bytes(self.read(_CYCLES_BYTES), "little"))
            else:
                self.fail()

    def close(self) -> None:
        """End the simulator, and close the device."""
        super().close()
        self._tap.close()

    def _receive(self, cycles: int) -> None:
        """Send the board a frame, or no bytes when the board's time is reached."""
        frame = self._tap.read(self.early(cycles))
        line = b""
        if frame:
            self.go_on()
            frame = frame.ljust(_SHORTEST, b"\0")
            line = _PREAMBLE + frame + _checksum(frame)
        self.write(len(line).to_bytes(_SIZE_BYTES, "little") + line)

    def _send(self) -> None:
        """Send a frame of the board to this machine. Raise `InputError` if it is broken."""
        line, self._sent = bytes(self._sent), bytearray()
        frame = line[len(_PREAMBLE) : -_FCS_BYTES]
        if not line.startswith(_PREAMBLE) or len(frame) < _SHORTEST or line[-_FCS_BYTES:] != _checksum(frame):
            fail(f"the board sent a broken frame: {line.hex()}")
        address = "" if _is_without_address(frame) else _announced(frame) or self._address
        if address != self._address:
            self._address = address
            self.on_address(address)
        self._tap.write(frame)


def _announced(frame: bytes) -> str:
    """Return the address that a frame announces (RFC 5227, section 2.3), or ""."""
    sender, target = frame[_SENDER_PLACE:][:_ADDRESS_BYTES], frame[_TARGET_PLACE:][:_ADDRESS_BYTES]
    return str(IPv4Address(sender)) if frame[12:22] == _ARP_REQUEST and sender == target else ""


def _is_without_address(frame: bytes) -> bool:
    """Return whether a frame is a DHCP message of a board without an address."""
    return frame[12:14] == _TYPE_IPV4 and frame[26:30] == bytes(4) and frame[34:38] == _DHCP_PORTS


def _checksum(frame: bytes) -> bytes:
    """Return the frame check sequence."""
    return zlib.crc32(frame).to_bytes(_FCS_BYTES, "little")
