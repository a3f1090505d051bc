"""Forward frames between a TAP device, which it makes, and another Ethernet device, and lose some of them:

    python lossy_line.py TAP DEVICE PERCENT SEED

It prints a line when the TAP device is there, and ends with its input; then it prints how many frames each way it has
lost on purpose. Frames from a TAP device have their checksums, in contrast to those between two network namespaces.
"""

from __future__ import annotations

import fcntl
import os
import random
import select
import socket
import struct
import sys
from contextlib import suppress

_SET_NAME, _TAP, _WITHOUT_HEADER = 0x400454CA, 2, 0x1000  # TUNSETIFF, IFF_TAP, IFF_NO_PI
_ALL, _LONGEST = 3, 65536  # ETH_P_ALL; bytes of a frame


def run(tap: str, device: str, loss: float, chance: random.Random) -> None:
    """Forward until the input ends."""
    line = os.open("/dev/net/tun", os.O_RDWR)
    fcntl.ioctl(line, _SET_NAME, struct.pack("16sH22x", tap.encode(), _TAP | _WITHOUT_HEADER))
    end = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(_ALL))
    end.bind((device, 0))
    print("ready", flush=True)
    lost = [0, 0]
    while sys.stdin not in (ready := select.select([line, end, sys.stdin], [], [])[0]):
        # A device that is down takes and gives nothing; what is not sent on then is not counted.
        with suppress(OSError):
            if line in ready:
                frame = os.read(line, _LONGEST)
                if chance.random() >= loss:
                    end.send(frame)
                else:
                    lost[0] += 1
        with suppress(OSError):
            if end in ready:
                frame, (_, _, kind, *_) = end.recvfrom(_LONGEST)
                if kind == socket.PACKET_OUTGOING:
                    continue
                if chance.random() >= loss:
                    os.write(line, frame)
                else:
                    lost[1] += 1
    print(*lost)


if __name__ == "__main__":
    run(sys.argv[1], sys.argv[2], float(sys.argv[3]) / 100, random.Random(int(sys.argv[4])))
