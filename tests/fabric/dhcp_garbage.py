"""Send replies of DHCP that are wrong to the board 02:00:00:00:00:09, until the program is ended."""

from __future__ import annotations

import random
import socket
import sys
import time
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.cores.dhcp import ACK, DISCOVER, NAK, OFFER, REQUEST, Message, meaning, random_message
from tests.cores.requests import MAC

BOARD = bytes.fromhex("020000000009")
_ALL_PROTOCOLS = 3
_NUMBER_PLACE, _PORTS = 46, b"\0\x44\0\x43"


def useless(chance: random.Random) -> Message:
    """A message that has no effect: its type is another one, or it is broken."""
    while True:
        message = random_message(chance, (OFFER, ACK, NAK, DISCOVER, REQUEST, 7))
        found = meaning(message)
        if found is None or found.type not in (OFFER, ACK, NAK):
            owner, mac = (BOARD if address == MAC else address for address in (message.owner, message.mac))
            return replace(message, owner=owner, mac=mac)


def main() -> None:
    """Send a frame each 20 ms, most with the number of the board's last request.

    One in four has no more than random bytes after its header of UDP.
    """
    chance = random.Random(20261127)
    number = bytes(4)
    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(_ALL_PROTOCOLS)) as line:
        line.bind((sys.argv[1], _ALL_PROTOCOLS))
        line.setblocking(False)
        while True:
            number = _heard(line) or number
            used = number if chance.random() < 0.9 else chance.randbytes(4)
            numbers = used + bytes(255 - byte for byte in used)
            frame = bytes(byte if byte < 256 else numbers[byte - 256] for byte in useless(chance).frame())
            if chance.random() < 0.25:
                frame = frame[:42] + chance.randbytes(chance.randrange(18, 1400))
            line.send(frame)
            time.sleep(0.02)


def _heard(line: socket.socket) -> bytes:
    """The number of the last request that has come from the board, or nothing."""
    number = b""
    while True:
        try:
            frame = line.recv(2048)
        except BlockingIOError:
            return number
        if frame[6:14] == BOARD + b"\x08\0" and frame[34:38] == _PORTS:
            number = frame[_NUMBER_PLACE:][:4]


if __name__ == "__main__":
    main()
