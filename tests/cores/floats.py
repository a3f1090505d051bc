"""Operands and results of robot:acc:firm_float in simulation."""

from __future__ import annotations

import random
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tests.cores import operations
from tests.cores.models import load_model
from tests.hdl.ghdl import Generic, Library, core_files
from tests.seeds import seeded

SEED = seeded(2718)
SIZES = {"float64": (11, 52), "float32": (8, 23)}
TYPES: dict[str, Any] = {"float64": np.float64, "float32": np.float32}
BITS: dict[str, Any] = {"float64": np.uint64, "float32": np.uint32}
MODEL = load_model("float")


def analysed(folder: Path) -> Library:
    """The core and its bench."""
    found = Library("firm", folder)
    found.analyse(core_files(*operations.CORES_OF_BENCHES, "acc/cordic/cordic", "acc/float/float"))
    found.analyse(core_files("acc/float/float", fileset="tb"))
    return found


class Numbers:
    """Operands of one size that meet every special case; each `piece` has others."""

    def __init__(self, name: str, piece: int = 0) -> None:
        self.name = name
        self.exponent_bits, self.mantissa_bits = SIZES[name]
        self.width = 1 + self.exponent_bits + self.mantissa_bits
        self.random = random.Random(f"{SEED} {name} {piece}" if piece else f"{SEED} {name}")
        top = ((1 << self.exponent_bits) - 1) << self.mantissa_bits
        least = 1 << self.mantissa_bits
        one = (2 ** (self.exponent_bits - 1) - 1) << self.mantissa_bits
        # Zero, subnormal numbers, the normal ones beside them, one and its neighbours, the largest, infinity, NaN.
        magnitudes = [0, 1, 2, 3, least >> 1, least - 1, least, least + 1, one - 1, one, one + 1, one + (least >> 1)]
        magnitudes += [top - 1, top, top + 1, top + (least >> 1), top + least - 1]
        self.specials = [sign << (self.width - 1) | bits for sign in (0, 1) for bits in magnitudes]

    def draw(self) -> int:
        """Draw a number: any bits, a special one, one of few bits, or one beside zero."""
        kind = self.random.random()
        bits = self.random.getrandbits(self.width)
        if kind < 0.1:
            return int(self.random.choice(self.specials))
        exponent = self.random.randint(-60, 60) + 2 ** (self.exponent_bits - 1) - 1
        field: int = min(max(exponent, 0), 2**self.exponent_bits - 2) << self.mantissa_bits
        sign = bits & (1 << (self.width - 1))
        fraction = bits & ((1 << self.mantissa_bits) - 1)
        if kind < 0.4:
            return sign | field | fraction
        if kind < 0.6:
            few = self.random.randint(0, self.mantissa_bits)
            return sign | field | fraction >> few << few
        if kind < 0.7:
            return sign | fraction >> self.random.randint(0, self.mantissa_bits)
        return bits

    def beside(self, bits: int) -> int:
        """A number whose exponent is near that of another one, of any sign."""
        near = bits + (self.random.randint(-2, 2) << self.random.randint(0, self.mantissa_bits))
        near ^= self.random.getrandbits(1) << (self.width - 1)
        return near & ((1 << self.width) - 1)

    def halves(self, bits: int) -> int:
        """A number whose sum with another one is a tie, or nearly."""
        exponent = (bits >> self.mantissa_bits) & ((1 << self.exponent_bits) - 1)
        field = max(exponent - self.mantissa_bits - 1, 0) << self.mantissa_bits
        return field + self.random.choice((-1, 0, 0, 0, 1)) & ((1 << self.width) - 1)

    def second(self, first: int) -> int:
        """A further operand."""
        return self.random.choice((lambda _: self.draw(), self.beside, self.halves))(first)

    def several(self, count: int, operands: int) -> list[list[int]]:
        """Rows of operands: every pair of special numbers, then any."""
        rows = [[a, b, *(self.draw() for _ in range(operands - 2))] for a in self.specials for b in self.specials]
        if operands == 1:
            rows = [[a] for a in self.specials]
        while len(rows) < count:
            first = self.draw()
            rows.append([first, *(self.second(first) for _ in range(operands - 1))])
        return rows

    def values(self, bits: Iterable[int]) -> Any:
        return np.array(list(bits), dtype=BITS[self.name]).view(TYPES[self.name])


def operate(
    library: Library, folder: Path, width: int, rows: Sequence[Sequence[int]], **generics: Generic
) -> tuple[list[int], str]:
    return operations.operate(library, "firm_float_tb", folder, [width], rows, SEED=SEED, **generics)


def check(numbers: Numbers, rows: Sequence[Sequence[int]], found: Sequence[int], expected: Any) -> None:
    """Every bit is equal; a NaN is the positive quiet one."""
    quiet = (2 ** (numbers.exponent_bits + 1) - 1) << (numbers.mantissa_bits - 1)
    wanted = np.where(np.isnan(expected), quiet, expected.view(BITS[numbers.name]))
    assert len(found) == len(wanted)
    wrong = [
        f"{[format(number, 'x') for number in row]}: {bits:x}, expected {int(right):x}"
        for row, bits, right in zip(rows, found, wanted, strict=True)
        if bits != right
    ]
    assert not wrong, "\n".join([f"{len(wrong)} wrong", *wrong[:20]])


def size_of(numbers: Numbers) -> dict[str, Generic]:
    return {"EXPONENT_BITS": numbers.exponent_bits, "MANTISSA_BITS": numbers.mantissa_bits}
