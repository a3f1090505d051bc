"""Clock, reset and the parts of a bench, which drive and sample ports once in each cycle.

All ports are driven at the falling edge and sampled after it, when nothing changes any more until the rising edge. So
a transfer is the same in every simulator, also through combinational paths.
"""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any, Protocol

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, ReadOnly

_RESET_CYCLES = 4
_PERIOD = 10


class Part(Protocol):
    """A part of a bench."""

    def drive(self) -> None:
        """Set the inputs of the hardware for the next rising edge."""

    def sample(self) -> None:
        """Take note of what the next rising edge transfers."""


class Stalls:
    """Random pauses: `percent` of the cycles; the same seed gives the same pauses.

    Without a seed, it depends on the seed that cocotb prints. The seed is printed.
    """

    def __init__(self, percent: int = 25, seed: int | None = None) -> None:
        self._percent = percent
        self._seed = random.getrandbits(32) if seed is None else seed
        self._parts = 0
        print(f"stalls: {percent} % of the cycles, seed={self._seed}", flush=True)

    def of_part(self) -> Callable[[], bool]:
        """Return a function that tells for a part of a bench whether its next cycle is a pause."""
        self._parts += 1
        source = random.Random(f"{self._seed} {self._parts}")
        return lambda: source.randrange(100) < self._percent


class Cycles:
    """The clock of a design, whose ports are `clk` and `rst_n`."""

    def __init__(self, dut: Any) -> None:
        self._dut = dut

    async def start(self, inputs: Iterable[str], parts: Iterable[Part], clocks: Iterable[str] = ()) -> None:
        """Drive the inputs with 0, start the clocks, reset the design, and let the parts work from now on."""
        for name in ("rst_n", *inputs):
            getattr(self._dut, name).value = 0
        for name in ("clk", *clocks):
            # A task in cocotb 2, a coroutine in cocotb 1.
            clock: Any = _clock(getattr(self._dut, name)).start()
            cocotb.start_soon(clock)
        for _ in range(_RESET_CYCLES):
            await FallingEdge(self._dut.clk)
        self._dut.rst_n.value = 1
        cocotb.start_soon(self._run(tuple(parts)))

    async def first(self, queue: deque[Any], limit: int, what: str, check: Callable[[], None]) -> Any:
        """Return the first item of a queue, as soon as there is one; fail after `limit` cycles without."""
        for _ in range(limit):
            check()
            if queue:
                return queue.popleft()
            await FallingEdge(self._dut.clk)
        raise AssertionError(f"{what} within {limit} cycles")

    async def _run(self, parts: tuple[Part, ...]) -> None:
        while True:
            await FallingEdge(self._dut.clk)
            for part in parts:
                part.drive()
            await ReadOnly()
            for part in parts:
                part.sample()


def _clock(port: Any) -> Clock:
    """Return a clock of 100 MHz, or of 10 steps if the simulator's steps are longer than a nanosecond."""
    try:
        return Clock(port, _PERIOD, "ns")
    except ValueError:
        return Clock(port, _PERIOD, "step")


def bits_of(port: Any) -> str:
    """Return the bits of a port, the highest first, as letters of VHDL or Verilog."""
    return str(port.value)


def number_of(port: Any) -> int:
    """Return the value of a port. Raise `AssertionError` if a bit is neither 0 nor 1."""
    bits = bits_of(port)
    if set(bits) - {"0", "1"}:
        name = getattr(port, "_name", "a port")
        raise AssertionError(f"the port {name} is undefined: {bits}")
    return int(bits, 2)
