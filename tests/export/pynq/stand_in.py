"""What a board with PYNQ has: a package written by `firm pynq`, and `pynq` with the model of the engine.

Written from PYNQ's documentation: a channel without scatter-gather transfers one buffer at a time, and refuses the next
one before `wait`; `MMIO` takes no subclass of int.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any, cast

import numpy as np
import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.export.pynq.driver import Driver
from tests.node.dma_engine import ADDRESS, Engine, Loop

SPECS = Path(__file__).parents[3] / "specs"
REGISTERS = 0x4040_0000
# Two topics to the hardware, and two from it with the same ids and types: a loop in place of the system answers.
SPECIFICATION = """\
project: {name: pair, width: 32}
accelerators:
  - name: copy
    type: VHDL
    sources: copy.vhd
    interface:
      input: [{middleware: ROS2, message: geometry_msgs/PointStamped}]
      output: [{middleware: ROS2, message: geometry_msgs/PointStamped}]
blocks:
  - {name: left, middleware: ROS2, mode: subscriber, message: geometry_msgs/PointStamped, outgoing: [{name: first}]}
  - {name: right, middleware: ROS2, mode: subscriber, message: geometry_msgs/PointStamped, outgoing: [{name: second}]}
  - {name: first, type: copy, outgoing: [{name: left_out}]}
  - {name: second, type: copy, outgoing: [{name: right_out}]}
  - {name: left_out, middleware: ROS2, mode: publisher, message: geometry_msgs/PointStamped, buffer: 256}
  - {name: right_out, middleware: ROS2, mode: publisher, message: geometry_msgs/PointStamped, buffer: 256}
"""


def written(folder: Path, *words: str, text: str = SPECIFICATION, board: str = "zynq7000") -> Path:
    """Write the package of a specification; return the package's folder."""
    spec = folder / "pair.yaml"
    spec.write_text(text, encoding="utf-8")
    assert main(["pynq", str(spec), "--board", board, "-o", str(folder / "overlay"), *words]) == 0
    (package,) = (path.parent for path in folder.glob("overlay/*/__init__.py"))
    return package


def add_files(package: Path) -> None:
    """Add what Vivado writes."""
    for ending in (".bit", ".hwh"):
        (package / package.name).with_suffix(ending).write_bytes(b"")


def installed(package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let Python find a package until the end of the test."""
    monkeypatch.syspath_prepend(package.parent)
    monkeypatch.setitem(sys.modules, package.name, ModuleType(package.name))
    del sys.modules[package.name]


def driver_of(package: Path, monkeypatch: pytest.MonkeyPatch) -> type[Driver]:
    """Import the class of a package."""
    installed(package, monkeypatch)
    module = importlib.import_module(package.name)
    (found,) = (item for item in vars(module).values() if isinstance(item, type) and Driver in item.__bases__)
    return cast("type[Driver]", found)


class Array(np.ndarray[Any, Any]):
    """An array that `allocate` returns."""

    physical_address = ADDRESS


@dataclass
class Board:
    """The engine of a board, and what was asked of PYNQ."""

    memory: bytearray = field(default_factory=lambda: bytearray(4 << 20))
    loaded: list[tuple[str, bool]] = field(default_factory=list)
    parameters: Mapping[str, str] = field(default_factory=lambda: {"c_include_sg": "1"})
    name: str = "dma"
    dma: Any = None

    def __post_init__(self) -> None:
        self.engine = Engine(memoryview(self.memory), ADDRESS)

    def pynq(self) -> ModuleType:
        """Return the module `pynq`."""
        module = ModuleType("pynq")
        vars(module).update(Overlay=self._overlay, MMIO=self._registers, allocate=self._allocate)
        return module

    def _overlay(self, bitstream: str, *, download: bool = True) -> Any:
        self.loaded.append((bitstream, download))
        made = ModuleType("overlay")
        description = {"phys_addr": REGISTERS, "addr_range": 0x10000, "parameters": self.parameters}
        vars(made).update(ip_dict={self.name: description, "system": {}}, dma=self.dma)
        return made

    def _registers(self, address: int, length: int) -> Any:
        assert (address, length) == (REGISTERS, 0x10000)
        engine = self.engine

        class Registers:
            def read(self, offset: int) -> int:
                return engine.read(offset)

            def write(self, offset: int, data: int) -> None:
                if type(data) is not int:
                    raise ValueError("Data type must be int or bytes.")
                engine.write(offset, data)

        return Registers()

    def _allocate(self, shape: tuple[int, ...], dtype: str = "u4") -> Array:
        if self.dma:
            return np.zeros(shape, dtype).view(Array)
        return np.frombuffer(self.memory, dtype).reshape(shape).view(Array)


@contextmanager
def board(monkeypatch: pytest.MonkeyPatch, **about: Any) -> Iterator[Board]:
    """A board with PYNQ. Fails if the driver breaks a rule of the engine."""
    made = Board(**about)
    monkeypatch.setitem(sys.modules, "pynq", made.pynq())
    try:
        yield made
    finally:
        made.engine.close()
    assert not made.engine.broken, made.engine.broken[0]


class Channel:
    """A channel of PYNQ's driver for an engine without scatter-gather, between memory and a loop."""

    def __init__(self, move: Callable[[memoryview], int | None]) -> None:
        self._move = move
        self._array: memoryview | None = None
        self._is_first = True
        self.is_running = False
        self.error = False
        self.transferred = 0

    def start(self) -> None:
        """Start the channel."""
        self.is_running = True

    @property
    def idle(self) -> bool:
        """Whether the last transfer has ended."""
        if self._array is not None and (size := self._move(self._array)) is not None:
            self.transferred, self._array = size, None
        return self._array is None and not self._is_first

    def transfer(self, array: Any, start: int = 0, nbytes: int = 0) -> None:
        """Begin a transfer."""
        if not self.is_running:
            raise RuntimeError("DMA channel not started")
        if not self.idle and not self._is_first:
            raise RuntimeError("DMA channel not idle")
        self._array, self._is_first = memoryview(array)[start : start + (nbytes or array.nbytes)], False

    def wait(self) -> None:
        """Wait for its end."""
        if self.error:
            raise RuntimeError("DMA Internal Error (transfer length 0?)")
        while not self.idle:
            pass


class SimpleDma:
    """PYNQ's driver of an engine without scatter-gather, before a loop."""

    def __init__(self, room: int = 2, buffer_max_size: int = 2**14 - 1) -> None:
        self.buffer_max_size = buffer_max_size
        self.resets = 0
        self._loop, self._room, self._waiting = Loop(room), room, 0
        self.sendchannel, self.recvchannel = Channel(self._send), Channel(self._receive)

    def read(self, offset: int) -> int:
        """Return the control register after a reset."""
        assert offset == 0
        return 0

    def write(self, offset: int, value: int) -> None:
        """Reset the engine."""
        assert (offset, value) == (0, 4)
        self.resets += 1
        self.sendchannel.is_running = self.recvchannel.is_running = False

    def _send(self, array: memoryview) -> int | None:
        if self._waiting >= self._room:
            return None
        self._waiting += 1
        self._loop.put(bytes(array), is_last=True, is_over=lambda: False)
        return len(array)

    def _receive(self, array: memoryview) -> int | None:
        # The engine sends, too, while nobody looks at that channel.
        _ = self.sendchannel.idle
        if (piece := self._loop.get()) is None:
            return None
        self._waiting -= 1
        array[: len(piece[0])] = piece[0]
        return len(piece[0])
