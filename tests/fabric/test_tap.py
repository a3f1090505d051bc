"""The TAP device of a simulated board, with a socket in its place, and a device that is removed."""

from __future__ import annotations

import errno
import os
import shutil
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from fusesoc_firm.fabric import ethernet_board
from fusesoc_firm.fabric.ethernet_board import Tap
from fusesoc_firm.text.diagnostics import InputError

# The name is free, also beside other runs of this test.
DEVICE = f"firm{os.getpid()}"


@pytest.fixture
def ends(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Tap, socket.socket]]:
    """A device, and its other end; a read takes a whole frame, and cuts it, as that of a TAP device."""
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    near.setblocking(False)
    monkeypatch.setattr(ethernet_board, "_is_up", lambda name: True)
    monkeypatch.setattr("fusesoc_firm.fabric.ethernet_board.os.open", lambda *_: os.dup(near.fileno()))
    monkeypatch.setattr("fusesoc_firm.fabric.ethernet_board.fcntl.ioctl", lambda *_: 0)
    tap = Tap(DEVICE)
    monkeypatch.undo()
    with near, far:
        yield tap, far
    tap.close()


def test_a_frame_that_is_too_long_is_dropped(ends: tuple[Tap, socket.socket]) -> None:
    tap, far = ends
    longest = bytes(range(256)) * 8
    for frame in (longest, longest + b"x", b"next"):
        far.send(frame)
    assert [tap.read(0) for _ in range(4)] == [longest, b"", b"next", b""]


def test_a_frame_without_room_is_lost(ends: tuple[Tap, socket.socket]) -> None:
    """Until then, and afterwards, frames arrive."""
    tap, far = ends
    far.settimeout(60)
    for number in range(5000):
        tap.write(number.to_bytes(2, "little") * 500)
    assert far.recv(2000)[:2] == bytes(2)
    tap.write(b"last")
    while far.recv(2000) != b"last":
        pass


@pytest.mark.parametrize("number", [errno.ENOBUFS, errno.EAGAIN])
def test_a_device_without_memory_loses_a_frame(
    ends: tuple[Tap, socket.socket], monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    def refuse(*_: object) -> int:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("fusesoc_firm.fabric.ethernet_board.os.write", refuse)
    ends[0].write(b"frame")


def test_a_device_is_closed_once(ends: tuple[Tap, socket.socket]) -> None:
    tap, _ = ends
    tap.close()
    with Path("/dev/null").open() as other:
        tap.close()
        os.fstat(other.fileno())


def test_a_device_that_is_removed_ends_the_board() -> None:
    add = ["ip", "tuntap", "add", "dev", DEVICE, "mode", "tap"]
    if not shutil.which("ip") or subprocess.run(add, capture_output=True, check=False).returncode:
        pytest.skip("no TAP device can be made here")
    try:
        subprocess.run(["ip", "link", "set", DEVICE, "up"], check=True)
        tap = Tap(DEVICE)
    finally:
        subprocess.run(["ip", "link", "delete", DEVICE], check=True)
    with pytest.raises(InputError, match=f"the network device '{DEVICE}' does not take a frame: "):
        tap.write(bytes(60))
    with pytest.raises(InputError, match=f"the network device '{DEVICE}' does not give a frame: "):
        tap.read(0)
    tap.close()
