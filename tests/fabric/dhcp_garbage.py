"""Send replies of DHCP that are wrong to the board 02:00:00:00:00:09, until the program is ended."""

from __future__ import annotations

import random
import socket
import sys
import time
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.cores.dhcp import ACK, NAK, OFFER, random_message

BOARD = bytes.fromhex("020000000009")


def main() -> None:
    """Send a frame each 20 ms; one in four has no more than random bytes after its header of UDP."""
    chance = random.Random(20261127)
    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW) as line:
        line.bind((sys.argv[1], 0))
        while True:
            message = replace(random_message(chance, (OFFER, ACK, NAK)), owner=BOARD, mac=BOARD)
            frame = bytes(byte if byte < 256 else chance.randrange(256) for byte in message.frame())
            if chance.random() < 0.25:
                frame = frame[:42] + chance.randbytes(chance.randrange(18, 1400))
            line.send(frame)
            time.sleep(0.02)


if __name__ == "__main__":
    main()
