"""Random expressions in VHDL: `signed`, `unsigned`, integers, bits and conditions. "Left out": see designs.py."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random

KINDS = ("signed", "unsigned", "std_logic_vector")
_SHIFTS = ("shift_left", "shift_right", "rotate_left", "rotate_right")
_NAME = re.compile(r"[A-Za-z]\w*")
# Widths at which words of 32 bits begin or end.
_EDGES = (1, 2, 31, 32, 33, 63, 64, 65, 95, 96, 97, 127, 128)
_LARGEST_INTEGER = 2**31 - 1
# Left out: decimal numbers that GHDL 2.0 takes for too large.
_REFUSED_NUMBERS = range(2147483600, 2147483640)


@dataclass(frozen=True)
class Vector:
    """An object that can be read: `kind` is signed, unsigned or std_logic_vector."""

    name: str
    kind: str
    width: int
    low: int = 0
    is_ascending: bool = False

    @property
    def bounds(self) -> str:
        high = self.low + self.width - 1
        return f"{self.low} to {high}" if self.is_ascending else f"{high} downto {self.low}"

    def part(self, offset: int, width: int) -> str:
        """Some of the bits, counted from the lowest index."""
        first, last = self.low + offset, self.low + offset + width - 1
        return f"{self.name}({first} to {last})" if self.is_ascending else f"{self.name}({last} downto {first})"


@dataclass(frozen=True)
class Integer:
    """An expression or object of type integer, and the range that it does not leave."""

    text: str
    low: int
    high: int


@dataclass
class Scope:
    """What an expression may read."""

    vectors: list[Vector] = field(default_factory=list)
    integers: list[Integer] = field(default_factory=list)
    bits: list[str] = field(default_factory=list)
    booleans: list[str] = field(default_factory=list)

    def inner(self) -> Scope:
        return Scope(list(self.vectors), list(self.integers), list(self.bits), list(self.booleans))


class Expressions:
    """Random expressions of what a scope holds."""

    def __init__(self, random: Random) -> None:
        self.random = random
        self.dynamic = {"x", "p", "n", "o"}

    def chance(self, share: float) -> bool:
        return self.random.random() < share

    def width(self, most: int = 128) -> int:
        kind = self.random.random()
        if kind < 0.6:
            found = self.random.randint(1, 16)
        elif kind < 0.8:
            found = self.random.randint(17, 70)
        elif kind < 0.95:
            found = self.random.choice(_EDGES)
        else:
            found = self.random.randint(71, 128)
        return min(found, most)

    # Constants

    def is_static(self, text: str) -> bool:
        """Whether an expression has none but constants; GHDL evaluates that itself, or says that it cannot."""
        return not any(word in self.dynamic for word in _NAME.findall(text))

    def pattern(self, width: int) -> int:
        """The bits of a constant: often at an edge, with zeros or ones below or above."""
        top = 1 << width
        place = self.random.randrange(width)
        return (
            self.random.choice(
                [
                    0,
                    1,
                    top - 1,
                    top >> 1,
                    (top >> 1) - 1,
                    1 << place,
                    top - (1 << place),
                    self.random.randrange(top) >> place << place,
                    self.random.randrange(top) >> place,
                    self.random.randrange(top),
                    self.random.randrange(top),
                ]
            )
            % top
        )

    def literal(self, kind: str, width: int) -> str:
        value = self.pattern(width)
        if _is_lost(value, width):
            value |= 1
        signed = value - (value >> width - 1 << width)
        if abs(signed) in _REFUSED_NUMBERS or value in _REFUSED_NUMBERS:
            value = signed = 1
        if kind == "signed" and -(2**31) < signed < 2**31 and self.chance(0.4):
            return f"to_signed({signed}, {width})"
        if kind == "unsigned" and value < 2**31 and self.chance(0.4):
            return f"to_unsigned({value}, {width})"
        if width % 4 == 0 and self.chance(0.5):
            return f'{kind}\'(X"{value:0{width // 4}X}")'
        return f'{kind}\'("{value:0{width}b}")'

    # Vectors

    def vector(self, scope: Scope, kind: str, width: int, depth: int) -> str:
        """An expression of a kind and width."""
        if depth <= 0 or self.chance(0.1):
            return self.leaf(scope, kind, width)
        found = self._computed_vector(scope, kind, width, depth)
        return self.leaf(scope, kind, width) if self.is_static(found) else found

    def _computed_vector(self, scope: Scope, kind: str, width: int, depth: int) -> str:
        if kind == "std_logic_vector":
            return self.random.choice([self._logical, self._concatenated, self._converted])(scope, kind, width, depth)
        makers: list[Callable[[Scope, str, int, int], str]] = [
            self._sum,
            self._sum,
            self._product,
            self._quotient,
            self._logical,
            self._shifted,
            self._shifted,
            self._resized,
            self._concatenated,
            self._converted,
            self._from_integer,
        ]
        if kind == "signed":
            makers += [self._negated]
        return self.random.choice(makers)(scope, kind, width, depth)

    def leaf(self, scope: Scope, kind: str, width: int) -> str:
        if self.chance(0.2):
            return self.literal(kind, width)
        fitting = [vector for vector in scope.vectors if vector.width >= width]
        if not fitting:
            return self.literal(kind, width)
        vector = self.random.choice(fitting)
        text = (
            vector.name if vector.width == width else vector.part(self.random.randint(0, vector.width - width), width)
        )
        return text if vector.kind == kind else f"{kind}({text})"

    def operand(self, scope: Scope, kind: str, width: int, depth: int, *, is_resized: bool = False) -> str:
        """An operand; where it gets another width, GHDL 2.0 crashes at a constant of more than 32 bits."""
        found = self.vector(scope, kind, width, depth - 1)
        if is_resized and width > 32 and self.is_static(found):
            return f"({self.input(kind, scope, width)})"
        return f"({found})"

    def input(self, kind: str, scope: Scope, width: int) -> str:
        """Bits that are not constant, some of them twice if there are few."""
        vector = scope.vectors[0]
        if vector.width >= width:
            return f"{kind}({vector.part(self.random.randint(0, vector.width - width), width)})"
        return f"{kind}(unsigned'(resize(unsigned({vector.name}), {width})))"

    def _sum(self, scope: Scope, kind: str, width: int, depth: int) -> str:
        operator = self.random.choice("+-")
        other = self._upto(width)
        left = self.operand(scope, kind, width, depth)
        right = self.operand(scope, kind, other, depth, is_resized=other < width)
        if self.chance(0.3):
            right = self.number(scope, kind, width, depth)
        return f"{right} {operator} {left}" if self.chance(0.3) else f"{left} {operator} {right}"

    def _upto(self, width: int) -> int:
        return width if self.chance(0.5) else self.random.randint(1, width)

    def number(self, scope: Scope, kind: str, width: int, depth: int) -> str:
        """An integer beside a vector of a width: a constant or an expression, negative only beside signed ones."""
        if self.chance(0.4):
            found = self.integer(scope, depth - 1)
            if kind == "signed" or found.low >= 0:
                return f"({found.text})"
        return f"({self.constant(kind, width)})"

    def constant(self, kind: str, width: int) -> int:
        bits = min(width, 31)
        value = self.pattern(bits)
        if kind == "signed":
            value -= value >> bits - 1 << bits
        return 0 if abs(value) in _REFUSED_NUMBERS else value

    def _product(self, scope: Scope, kind: str, width: int, depth: int) -> str:
        if width == 1:
            return self._logical(scope, kind, width, depth)
        if width % 2 == 0 and self.chance(0.3):
            half = width // 2
            left = self.operand(scope, kind, half, depth)
            right = self.number(scope, kind, self.random.choice([half, 31]), depth)
            return f"{right} * {left}" if self.chance(0.5) else f"{left} * {right}"
        left_width = self.random.randint(1, width - 1)
        left, right = (
            self.operand(scope, kind, size, depth, is_resized=True) for size in (left_width, width - left_width)
        )
        return f"{left} * {right}"

    def _quotient(self, scope: Scope, kind: str, width: int, depth: int) -> str:
        # Left out: more than 64 bits, which Icarus 11 may divide wrongly; 65'h1e000000000000000 by a signal of 1 is 0.
        if width > 64:
            return self._logical(scope, kind, width, depth)
        operator = self.random.choice(["/", "mod", "rem"])
        other = self.random.choice([width, self._upto(width), self.width(64)])
        left, right = (width, other) if operator == "/" else (other, width)
        dividend = self.operand(scope, kind, left, depth, is_resized=True)
        divisor = self._nonzero(scope, kind, right, depth)
        if self.chance(0.3):
            # The quotient of a number would have the divisor's width.
            dividend = self.operand(scope, kind, width, depth, is_resized=True)
            divisor = self._divisor(scope, kind, depth)
        elif self.chance(0.2):
            # Left out: other numbers that do not fit, at which numeric_std warns, or ends a simulation.
            is_any = kind == "unsigned" and operator == "/"
            number = self.number(scope, kind, 31, depth) if is_any else f"({self.constant(kind, width)})"
            dividend, divisor = number, self._nonzero(scope, kind, width, depth)
        return f"{dividend} {operator} {divisor}"

    def _divisor(self, scope: Scope, kind: str, depth: int) -> str:
        """An integer other than zero."""
        if self.chance(0.5):
            return f"({self.constant(kind, 31) or 1})"
        return f"(({self.integer(scope, depth - 1).text}) mod {self.random.choice([1, 2, 5, 100, 70000])} + 1)"

    def _nonzero(self, scope: Scope, kind: str, width: int, depth: int) -> str:
        one = "0" * (width - 1) + "1"
        return f'({self.operand(scope, kind, width, depth, is_resized=True)} or {kind}\'("{one}"))'

    def _logical(self, scope: Scope, kind: str, width: int, depth: int) -> str:
        left, right = (self.operand(scope, kind, width, depth) for _ in range(2))
        if self.chance(0.2):
            return f"not {left}"
        return f"{left} {self.random.choice(['and', 'or', 'xor', 'nand', 'nor', 'xnor'])} {right}"

    def _shifted(self, scope: Scope, kind: str, width: int, depth: int) -> str:
        value = self.vector(scope, kind, width, depth - 1)
        if self.chance(0.4):
            count = self.random.choice([0, 1, width - 1, width, width + 1, self.random.randint(0, 2 * width)])
            if self.chance(0.2) and width > 1:
                return f"({value}) {self.random.choice(['rol', 'ror'])} {count}"
            if self.chance(0.2):
                return f"({value}) {self.random.choice(['sll', 'srl'])} ({self.random.choice([1, -1]) * count})"
            return f"{self.shift(kind, width)}({value}, {count})"
        if self.chance(0.2):
            return f"({value}) {self.random.choice(['sll', 'srl'])} {self.integer(scope, depth - 1).text}"
        return f"{self.shift(kind, width)}({value}, {self.integer(scope, depth - 1, least=0).text})"

    def shift(self, kind: str, width: int) -> str:
        """A function that shifts or rotates.

        Left out: rotations of signed numbers, which GHDL 2.0 does not know, and of one bit, where it crashes.
        """
        return self.random.choice(_SHIFTS[:2] if kind == "signed" or width == 1 else _SHIFTS)

    def _resized(self, scope: Scope, kind: str, width: int, depth: int) -> str:
        other = self.width()
        value = self.vector(scope, kind, other, depth - 1)
        if other > 32 and self.is_static(value):
            value = self.input(kind, scope, min(other, scope.vectors[0].width))
        return f"resize({value}, {width})"

    def _concatenated(self, scope: Scope, kind: str, width: int, depth: int) -> str:
        if width == 1:
            return self._logical(scope, kind, width, depth)
        low = self.random.randint(1, width - 1)
        parts = [self.operand(scope, kind, size, depth) for size in (width - low, low)]
        if width - low == 1 and self.chance(0.5):
            parts[0] = f"({self.bit(scope, depth - 1)})"
        return f"{kind}'({' & '.join(parts)})"

    def _converted(self, scope: Scope, kind: str, width: int, depth: int) -> str:
        other = self.random.choice([name for name in KINDS if name != kind])
        return f"{kind}({self.typed(scope, other, width, depth - 1)})"

    def typed(self, scope: Scope, kind: str, width: int, depth: int) -> str:
        """An expression whose type is known from it alone."""
        return f"{kind}'({self.vector(scope, kind, width, depth)})"

    def _negated(self, scope: Scope, kind: str, width: int, depth: int) -> str:
        return f"{self.random.choice(['-', 'abs '])}{self.operand(scope, kind, width, depth)}"

    def _from_integer(self, scope: Scope, kind: str, width: int, depth: int) -> str:
        number = self.integer(scope, depth - 1, least=None if kind == "signed" else 0)
        bits = max(number.high.bit_length(), (-number.low - 1).bit_length() if number.low < 0 else 0) + (
            kind == "signed"
        )
        if bits <= width:
            return f"to_{kind}({number.text}, {width})"
        return f"resize(to_{kind}({number.text}, {bits}), {width})"

    # Integers

    def integer(self, scope: Scope, depth: int, least: int | None = None) -> Integer:
        """An expression of type integer; not below `least` if it is given."""
        for _ in range(4):
            found = self._any_integer(scope, depth)
            if (least is None or found.low >= least) and not self.is_static(found.text):
                return found
        width = min(self.random.randint(1, 8), scope.vectors[0].width)
        return Integer(f"to_integer(unsigned({scope.vectors[0].part(0, width)}))", 0, 2**width - 1)

    def _any_integer(self, scope: Scope, depth: int) -> Integer:
        if depth > 0 and self.chance(0.5):
            return self._computed(scope, depth)
        if scope.integers and self.chance(0.6):
            return self.random.choice(scope.integers)
        if self.chance(0.15):
            value = self.random.choice([0, 1, -1, 2, 7, -8, 100, -100, self.random.randint(-70000, 70000)])
            return Integer(f"({value})", value, value)
        width = self.random.choice([self.random.randint(2, 8), self.random.randint(2, 31)])
        if self.chance(0.5):
            return Integer(
                f"to_integer({self.typed(scope, 'signed', width, depth - 1)})",
                -(2 ** (width - 1)),
                2 ** (width - 1) - 1,
            )
        return Integer(f"to_integer({self.typed(scope, 'unsigned', width, depth - 1)})", 0, 2**width - 1)

    def _computed(self, scope: Scope, depth: int) -> Integer:
        left, right = self._any_integer(scope, depth - 1), self._any_integer(scope, depth - 1)
        # Left out: `abs` of an integer, which GHDL 2.0 does not synthesise.
        operator = self.random.choice(["+", "-", "*", "/", "mod", "rem", "neg"])
        match operator:
            case "+":
                found = Integer(f"({left.text} + {right.text})", left.low + right.low, left.high + right.high)
            case "-":
                found = Integer(f"({left.text} - {right.text})", left.low - right.high, left.high - right.low)
            case "*":
                ends = [a * b for a in (left.low, left.high) for b in (right.low, right.high)]
                found = Integer(f"({left.text} * {right.text})", min(ends), max(ends))
            case "neg":
                found = Integer(f"(-({left.text}))", -left.high, -left.low)
            case _:
                found = self._divided(left, right, operator)
        fits = all(abs(end) <= _LARGEST_INTEGER and abs(end) not in _REFUSED_NUMBERS for end in (found.low, found.high))
        return found if fits else left

    def _divided(self, left: Integer, right: Integer, operator: str) -> Integer:
        if not right.low > 0:
            value = self.random.choice([1, 2, 3, 8, 10, -1, -2, -7, 1000])
            right = Integer(f"({value})", value, value)
        text = f"({left.text} {operator} {right.text})"
        largest = max(abs(right.low), abs(right.high))
        if operator == "/":
            most = max(abs(left.low), abs(left.high))
            return Integer(text, -most, most)
        if operator == "rem":
            return Integer(text, -(largest - 1) if left.low < 0 else 0, largest - 1)
        return Integer(text, 0, largest - 1) if right.low > 0 else Integer(text, 1 - largest, 0)

    # Bits and conditions

    def bit(self, scope: Scope, depth: int) -> str:
        """An expression of type std_logic."""
        if depth > 0 and self.chance(0.4):
            left, right = self.bit(scope, depth - 1), self.bit(scope, depth - 1)
            operator = self.random.choice(["and", "or", "xor", "nand", "nor", "xnor"])
            return f"(({left}) {operator} ({right}))"
        if scope.bits and self.chance(0.3):
            return self.random.choice(scope.bits)
        vector = self.random.choice([item for item in scope.vectors if not self.is_static(item.name)])
        index: str | int = vector.low + self.random.randrange(vector.width)
        # Left out: the only bit of a vector by a dynamic index, at which GHDL 2.0 may crash.
        if vector.width > 1 and self.chance(0.2):
            index = self.index(scope, vector, depth)
        return f"{vector.name}({index})"

    def index(self, scope: Scope, vector: Vector, depth: int) -> str:
        """A dynamic index of a vector."""
        text = self.below(scope, vector.width, depth)
        return f"{text} + {vector.low}" if vector.low else text

    def below(self, scope: Scope, size: int, depth: int) -> str:
        """An expression of type integer from 0 to `size` - 1."""
        bits = size.bit_length() - 1
        if size == 1 << bits and bits and self.chance(0.7):
            found = self.typed(scope, "unsigned", bits, depth - 1)
            return f"to_integer({self.input('unsigned', scope, bits) if self.is_static(found) else found})"
        return f"({self.integer(scope, depth - 1).text}) mod {size}"

    def condition(self, scope: Scope, depth: int) -> str:
        """An expression of type boolean."""
        found = self._any_condition(scope, depth)
        return f"{self.bit(scope, 0)} = '1'" if self.is_static(found) else found

    def _any_condition(self, scope: Scope, depth: int) -> str:
        if depth > 0 and self.chance(0.25):
            left, right = self.condition(scope, depth - 1), self.condition(scope, depth - 1)
            return (
                f"not ({left})"
                if self.chance(0.2)
                else f"({left}) {self.random.choice(['and', 'or', 'xor'])} ({right})"
            )
        if scope.booleans and self.chance(0.2):
            return self.random.choice(scope.booleans)
        if self.chance(0.3):
            return f"{self.bit(scope, depth)} = '{self.random.choice('01')}'"
        operator = self.random.choice(["=", "/=", "<", "<=", ">", ">="])
        if self.chance(0.3):
            left, right = (self.integer(scope, depth).text for _ in range(2))
            return f"{left} {operator} {right}"
        kind = self.random.choice(["signed", "unsigned"])
        width, other = self.width(), self.width()
        left, right = (self.operand(scope, kind, size, depth, is_resized=True) for size in (width, other))
        if self.chance(0.4):
            right = self.number(scope, kind, self.random.choice([width, 31]), depth)
        return f"{right} {operator} {left}" if self.chance(0.3) else f"{left} {operator} {right}"


def _is_lost(value: int, width: int) -> bool:
    """Whether GHDL 2.0 takes a constant for zero: whole words of which only the highest has a bit set."""
    return width > 32 and width % 32 == 0 and value % (1 << width - 32) == 0 and value != 0
