"""The kernel as a peer of the simulated board, in a network namespace of its own:

    unshare --net python net_peer.py PROGRAM

PROGRAM is the board at the device tap0. The kernel finds it by ARP, and verifies the checksums of its echo replies.
Prints what was found as JSON.
"""

from __future__ import annotations

import json
import random
import shutil
import socket
import struct
import subprocess
import sys
from pathlib import Path

BOARD = "192.0.2.2"
LONGEST = 1472  # bytes of data that an echo request carries without fragments
COMMANDS = (
    ["ping", "-q", "-c", "20", "-i", "0.01", "-w", "20", BOARD],
    ["ping", "-q", "-c", "20", "-i", "0.01", "-w", "20", "-s", str(LONGEST), BOARD],
    ["arping", "-q", "-c", "2", "-w", "20", "-I", "tap0", BOARD],
)


def set_up() -> None:
    """The device, and the right to open sockets for echo requests."""
    Path("/proc/sys/net/ipv4/ping_group_range").write_text("0 0")
    Path("/proc/sys/net/ipv6/conf/default/disable_ipv6").write_text("1")
    for command in ("tuntap add dev tap0 mode tap", "addr add 192.0.2.1/24 dev tap0", "link set tap0 up"):
        subprocess.run(["ip", *command.split()], check=True)


def echo(data: bytes, number: int) -> bytes:
    """The data that comes back; the kernel fills in identifier and checksum, and verifies that of the reply."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM, socket.IPPROTO_ICMP) as pings:
        pings.settimeout(20)
        pings.sendto(struct.pack(">BBHHH", 8, 0, 0, 0, number) + data, (BOARD, 0))
        reply = pings.recv(65536)
    assert reply[0] == 0
    assert struct.unpack(">H", reply[6:8]) == (number,)
    return reply[8:]


def counts() -> dict[str, int]:
    """What the kernel counts of ICMP."""
    names, values = (
        line.split()[1:] for line in Path("/proc/net/snmp").read_text().splitlines() if line.startswith("Icmp:")
    )
    return {name: int(value) for name, value in zip(names, values, strict=True)}


def neighbour() -> str:
    """The MAC address that the kernel knows of the board."""
    words = subprocess.run(["ip", "neigh", "show", BOARD], capture_output=True, text=True, check=True).stdout.split()
    return words[words.index("lladdr") + 1]


def main() -> None:
    """Send echo requests of all sizes, and run the programs that are installed."""
    set_up()
    random_ = random.Random(1)
    sizes = [0, 1, 2, LONGEST - 1, LONGEST, *(random_.randrange(LONGEST + 1) for _ in range(295))]
    messages = [random_.choice([random_.randbytes(size), bytes(size), b"\xff" * size]) for size in sizes]
    with subprocess.Popen([sys.argv[1]], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as board:
        assert board.stdin and board.stdout
        assert board.stdout.readline() == "ready\n"
        replies = [echo(data, number) for number, data in enumerate(messages)]
        programs = {
            " ".join(command): subprocess.run(command, stdout=subprocess.DEVNULL, check=False).returncode
            for command in COMMANDS
            if shutil.which(command[0])
        }
        found = {
            "sent": len(messages),
            "answered": len(replies),
            "different": sum(data != reply for data, reply in zip(messages, replies, strict=True)),
            "neighbour": neighbour(),
            "InErrors": counts()["InErrors"],
            "InCsumErrors": counts()["InCsumErrors"],
            "programs": programs,
        }
        board.stdin.close()
        assert board.wait() == 0
    print(json.dumps(found))


if __name__ == "__main__":
    main()
