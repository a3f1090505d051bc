"""The models of both chips under WIZnet's own driver, where IOLIBRARY names a folder with its ioLibrary_Driver.

The driver is compiled as a library of this process, and its SPI is a function here.
"""

from __future__ import annotations

import ctypes
import os
import random
import socket
import subprocess
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from fusesoc_firm.fabric.wiznet.chip import Chip, Status
from fusesoc_firm.fabric.wiznet.chips import MODELS
from fusesoc_firm.fabric.wiznet.spi import exchange
from tests.seeds import seeded
from tests.wiznet.peers import echo, free_port

SEED = seeded(20261126)
FOLDER = os.environ.get("IOLIBRARY", "")
TCP, NO_FLAG = 1, 0
SOCKERR_SOCKCLOSED, SOCKERR_TIMEOUT = -4, -13

pytestmark = pytest.mark.skipif(not FOLDER, reason="IOLIBRARY names no folder")

_SELECT = ctypes.CFUNCTYPE(None)
_READ = ctypes.CFUNCTYPE(ctypes.c_uint8)
_WRITE = ctypes.CFUNCTYPE(None, ctypes.c_uint8)


class NetInfo(ctypes.Structure):
    """`wiz_NetInfo`: what the driver writes into the common registers."""

    _fields_ = [
        ("mac", ctypes.c_uint8 * 6),
        ("ip", ctypes.c_uint8 * 4),
        ("sn", ctypes.c_uint8 * 4),
        ("gw", ctypes.c_uint8 * 4),
        ("dns", ctypes.c_uint8 * 4),
        ("dhcp", ctypes.c_int),
    ]


class Driven(NamedTuple):
    """A chip, its driver, and the functions that the driver calls, which must live as long."""

    chip: Chip
    driver: Any
    functions: tuple[Any, ...]


@pytest.fixture(params=MODELS, ids="w{}".format)
def driven(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Driven]:
    chip = MODELS[request.param]()
    driver = ctypes.CDLL(str(_compiled(request.param, tmp_path)))
    functions = (
        _SELECT(chip.select),
        _SELECT(chip.deselect),
        _READ(lambda: exchange(chip, 0)),
        _WRITE(chip.take),
    )
    driver.reg_wizchip_cs_cbfunc(*functions[:2])
    driver.reg_wizchip_spi_cbfunc(*functions[2:])
    sizes = (ctypes.c_uint8 * 8)(*[2] * 8)
    assert driver.wizchip_init(sizes, sizes) == 0
    info = NetInfo(mac=(2, 0, 0, 0, 0, 1), ip=(127, 0, 0, 1), sn=(255, 0, 0, 0))
    driver.wizchip_setnetinfo(ctypes.byref(info))
    yield Driven(chip, driver, functions)
    misuses = chip.misuses
    chip.close()
    assert not misuses


def _compiled(number: int, folder: Path) -> Path:
    ethernet = Path(FOLDER, "Ethernet")
    sources = [ethernet / "socket.c", ethernet / "wizchip_conf.c", ethernet / f"W{number}" / f"w{number}.c"]
    made = folder / "driver.so"
    # Its functions are called like those of the C library.
    options = ["-shared", "-fPIC", "-w", "-Wl,-Bsymbolic", f"-D_WIZCHIP_=W{number}", f"-I{ethernet}"]
    subprocess.run(["gcc", *options, *map(str, sources), "-o", str(made)], check=True)
    return made


def _address(server: socket.socket) -> tuple[Any, int]:
    return (ctypes.c_uint8 * 4)(127, 0, 0, 1), server.getsockname()[1]


def _received(driver: Any, number: int, length: int) -> bytes:
    data = b""
    while len(data) < length:
        buffer = (ctypes.c_uint8 * (length - len(data)))()
        count = driver.recv(number, buffer, len(buffer))
        assert count > 0
        data += bytes(buffer[:count])
    return data


def test_both_directions_of_a_connection_keep_every_byte(driven: Driven) -> None:
    """80 kB cross the ends of the buffers, and the pointers' end at 65,536."""
    print(f"seed {SEED}")
    rng = random.Random(SEED)
    driver = driven.driver
    with socket.create_server(("127.0.0.1", 0)) as server, ThreadPoolExecutor() as pool:
        echoing = pool.submit(echo, server)
        assert driver.socket(3, TCP, 50000, NO_FLAG) == 3
        assert driver.connect_W5x00(3, *_address(server)) == 1
        for _ in range(80):
            data = rng.randbytes(rng.randrange(1, 2048))
            assert driver.send(3, (ctypes.c_uint8 * len(data))(*data), len(data)) == len(data)
            assert _received(driver, 3, len(data)) == data
        assert driver.disconnect(3) == 1
        echoing.result()


def test_a_server_takes_a_connection(driven: Driven) -> None:
    driver = driven.driver
    port = free_port()
    assert driver.socket(5, TCP, port, NO_FLAG) == 5
    assert driver.listen(5) == 1
    with socket.create_connection(("127.0.0.1", port)) as peer:
        peer.sendall(b"to the chip")
        while driven.chip.sockets[5].status != Status.ESTABLISHED:
            driven.chip.poll(0.01)
        assert _received(driver, 5, 11) == b"to the chip"
        assert driver.send(5, (ctypes.c_uint8 * 13)(*b"from the chip"), 13) == 13
        assert peer.recv(100) == b"from the chip"
    assert driver.disconnect(5) == 1


def test_a_refused_connection_is_reported(driven: Driven) -> None:
    driver = driven.driver
    assert driver.socket(1, TCP, 50001, NO_FLAG) == 1
    target = (ctypes.c_uint8 * 4)(127, 0, 0, 1), free_port()
    assert driver.connect_W5x00(1, *target) in {SOCKERR_SOCKCLOSED, SOCKERR_TIMEOUT}
