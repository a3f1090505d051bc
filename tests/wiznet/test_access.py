"""firm_wiznet_access at its pins, in front of the models of both chips: every byte at its place, at every wrap."""

from __future__ import annotations

import random
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, NamedTuple

import pytest

from fusesoc_firm.fabric.wiznet.chips import MODELS
from fusesoc_firm.fabric.wiznet.spi import Slave
from fusesoc_firm.fabric.wiznet.w5200 import W5200
from fusesoc_firm.fabric.wiznet.w5500 import W5500
from tests.hdl.ghdl import Generic, Library, core_files
from tests.hdl.verilator import compiled
from tests.hdl.verilog import loops, netlist
from tests.seeds import seeded

SEED = seeded(20261126)
HERE = Path(__file__).parent
HARDWARE = core_files("cdc/sync", "net/wiznet")
BUFFER = 2048  # bytes of each buffer
COMMON, REGISTERS, TRANSMIT, RECEIVE = range(4)
# Registers that keep what is written.
KEPT = {COMMON: range(0x01, 0x13), REGISTERS: range(0x0C, 0x16)}


class Line(NamedTuple):
    """The pins' times: those of the master, the cycles after which the slave's bit is at the pin, and stalls."""

    mode: int
    half_bit: int
    read_delay: int
    miso_delay: int
    stall: int


LINES = (Line(0, 1, 0, 0, 0), Line(3, 1, 1, 1, 50), Line(0, 2, 2, 3, 30), Line(3, 5, 0, 0, 30))


@dataclass
class Pins:
    """The hardware, whose slave is a model."""

    process: subprocess.Popen[bytes]
    slave: Slave

    def write(self, space: int, socket: int, address: int, data: bytes) -> None:
        """Write bytes."""
        self._access(b"W", space, socket, address, len(data), data)

    def read(self, space: int, socket: int, address: int, length: int) -> bytes:
        """Read bytes."""
        return self._access(b"R", space, socket, address, length)

    def _access(self, kind: bytes, space: int, socket: int, address: int, length: int, data: bytes = b"") -> bytes:
        self._send(kind + bytes([space, socket]) + address.to_bytes(2, "big") + length.to_bytes(2, "big") + data)
        while (event := self._receive(1)) != b"D":
            match event:
                case b"s":
                    self.slave.select()
                case b"a":
                    self._send(bytes([self.slave.answer()]))
                case b"t":
                    self.slave.take(self._receive(1)[0])
                case b"d":
                    self.slave.deselect()
        return self._receive(length) if kind == b"R" else b""

    def _send(self, data: bytes) -> None:
        _pipe(self.process.stdin).write(data)
        _pipe(self.process.stdin).flush()

    def _receive(self, length: int) -> bytes:
        data = _pipe(self.process.stdout).read(length)
        assert len(data) == length, "the bench has ended"
        return data


def _pipe(pipe: IO[bytes] | None) -> IO[bytes]:
    assert pipe
    return pipe


@contextmanager
def _pins(folder: Path, number: int, line: Line) -> Iterator[tuple[Pins, W5200 | W5500]]:
    generics: dict[str, Generic] = {
        "CHIP": number,
        "MODE": line.mode,
        "HALF_BIT": line.half_bit,
        "READ_DELAY": line.read_delay,
    }
    verilog = netlist("firm_wiznet_access", folder, HARDWARE[-1:], HARDWARE[:-1], (), **generics)
    bench = (HERE / "access.cpp").read_text(encoding="ascii")
    program = compiled(verilog.read_text(encoding="utf-8"), "firm_wiznet_access", bench, folder, (HERE,))
    chip = MODELS[number]()
    words = [str(program), *map(str, (line.mode, line.half_bit, line.miso_delay, line.stall, SEED))]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        yield Pins(process, chip), chip
    chip.close()
    assert process.returncode == 0


def _address(rng: random.Random, space: int) -> int:
    """An address. In a buffer, it is a pointer, and every other one is close to the end of the buffer."""
    if space in KEPT:
        return rng.choice(KEPT[space])
    return rng.randrange(0x10000) if rng.random() < 0.5 else (rng.randrange(32) + 1) * BUFFER - rng.randrange(1, 20)


@pytest.mark.check
@pytest.mark.parametrize("line", LINES, ids=lambda line: f"mode{line.mode}_half{line.half_bit}_stall{line.stall}")
@pytest.mark.parametrize("number", MODELS)
def test_every_byte_is_written_and_read_at_its_place(tmp_path: Path, number: int, line: Line) -> None:
    print(f"seed {SEED}")
    rng = random.Random(SEED + number)
    with _pins(tmp_path, number, line) as (pins, chip):
        expected: dict[tuple[int, int, int], int] = {}
        for _ in range(150):
            space, socket = rng.choice((COMMON, REGISTERS, TRANSMIT)), rng.randrange(8)
            address = _address(rng, space)
            room = KEPT[space].stop - address if space in KEPT else rng.choice((1, 30, 64))
            length = rng.randrange(1, room + 1)
            places = [_place(space, socket, address + index) for index in range(length)]
            if rng.random() < 0.5:
                data = rng.randbytes(length)
                pins.write(space, socket, address, data)
                expected |= dict(zip(places, data, strict=True))
            elif all(place in expected for place in places):
                assert pins.read(space, socket, address, length) == bytes(expected[place] for place in places)
        for place, value in expected.items():
            assert pins.read(*place, 1) == bytes([value]), place
        for item in chip.sockets:
            item.rx[:] = rng.randbytes(len(item.rx))
            pointer = _address(rng, RECEIVE)
            wanted = bytes(item.rx[(pointer + index) % BUFFER] for index in range(BUFFER))
            assert pins.read(RECEIVE, item.number, pointer, BUFFER) == wanted
        assert not chip.misuses


def _place(space: int, socket: int, address: int) -> tuple[int, int, int]:
    """Where a byte is; common registers have no socket."""
    return space, socket if space else 0, address % BUFFER if space == TRANSMIT else address


@pytest.mark.parametrize(
    ("entity", "generics", "message"),
    [
        ("firm_wiznet_access", {"CHIP": 5100}, "CHIP is 5100; legal: 5200 and 5500"),
        ("firm_wiznet_access", {"BUFFER_BYTES": 4096}, "BUFFER_BYTES is 4096; legal: 1024 and 2048"),
        ("firm_spi_master", {"MODE": 1}, "MODE is 1; legal: 0 and 3"),
        ("firm_spi_master", {"HALF_BIT": 0}, "HALF_BIT is 0; legal: 1 to 65536"),
        ("firm_spi_master", {"READ_DELAY": 4}, r"READ_DELAY is 4; legal: 0 to 2*HALF_BIT-1"),
    ],
)
def test_illegal_generics_are_reported(
    tmp_path: Path, entity: str, generics: dict[str, int | str | bool], message: str
) -> None:
    library = Library("firm", tmp_path)
    library.analyse(HARDWARE)
    result = library.run(entity, generics)
    assert result.exit_code != 0
    assert message in result.output


def test_it_has_neither_latch_nor_loop(tmp_path: Path) -> None:
    library = Library("firm", tmp_path)
    library.analyse(HARDWARE)
    assert library.latches("firm_wiznet_access") == []
    assert loops("firm_wiznet_access", tmp_path, HARDWARE[-1:], HARDWARE[:-1]) == []
