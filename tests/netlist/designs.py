"""Random VHDL that synthesis takes: expressions and processes on `signed`, `unsigned` and integers.

A design is an entity with a clock, a reset, an input of 128 bits and an output of up to 128. Whatever it computes is
defined: nothing is divided by zero, no index and no integer leaves its range, and each register has a first value or a
reset. So GHDL's simulation is right by definition, and a netlist must say the same.

What is left out on purpose, as GHDL 2.0 synthesises it wrongly or not at all and a netlist does not show it, is listed
in docs/reference/netlist.md and marked with "Left out" here.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random

INPUT = OUTPUT = 128
# Widths at which words of 32 bits begin or end.
_EDGES = (1, 2, 31, 32, 33, 63, 64, 65, 95, 96, 97, 127, 128)
_LARGEST_INTEGER = 2**31 - 1
# Left out: decimal numbers that GHDL 2.0 takes for too large.
_REFUSED_NUMBERS = range(2147483600, 2147483640)


@dataclass(frozen=True)
class Design:
    """An entity and its architecture."""

    name: str
    seed: str
    text: str


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


@dataclass(frozen=True)
class Target:
    """A signal or variable that a process assigns."""

    vector: Vector
    sign: str = "<="
    # Left out: a register whose bits are written by a dynamic index and read by constant ones. GHDL 2.0 takes it for a
    # memory and loses it; the translation sees that and does without memories, all of them.
    may_be_memory: bool = True


def design(name: str, seed: str) -> Design:
    """The design of a seed."""
    return _Maker(name, Random(seed)).design(seed)


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
        return self.random.choice(SHIFTS[:2] if kind == "signed" or width == 1 else SHIFTS)

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


_NAME = re.compile(r"[A-Za-z]\w*")
KINDS = ("signed", "unsigned", "std_logic_vector")
SHIFTS = ("shift_left", "shift_right", "rotate_left", "rotate_right")


def _is_lost(value: int, width: int) -> bool:
    """Whether GHDL 2.0 takes a constant for zero: whole words of which only the highest has a bit set."""
    return width > 32 and width % 32 == 0 and value % (1 << width - 32) == 0 and value != 0


class _Maker(Expressions):
    """Makes one architecture, a block after the other; each may read what those before it have made."""

    def __init__(self, name: str, random: Random) -> None:
        super().__init__(random)
        self.name = name
        self.scope = Scope([Vector("x", "std_logic_vector", INPUT)])
        self.types: list[str] = []
        self.signals: list[str] = []
        self.statements: list[str] = []
        self.made = 0
        self._words: list[str] = []

    def design(self, seed: str) -> Design:
        blocks: list[Callable[[], None]] = [
            self._assignment,
            self._assignment,
            self._assignment,
            self._conditional,
            self._selected,
            self._logic,
            self._registers,
            self._registers,
            self._memory,
            self._table,
            self._array,
            self._function,
            self._enumeration,
            self._record,
            self._integer_signal,
            self._generated,
        ]
        for _ in range(self.random.randint(1, 5)):
            self.random.choice(blocks)()
        return Design(self.name, seed, self._text())

    def _text(self) -> str:
        results = self.scope.vectors[1:] or [self.scope.vectors[0]]
        chosen: list[str] = []
        free = OUTPUT
        for vector in reversed(results):
            if vector.width <= free:
                chosen.append(f"std_logic_vector({vector.name})")
                free -= vector.width
        for integer in self.scope.integers:
            if free >= 32:
                chosen.append(f"std_logic_vector(to_signed({integer.text}, 32))")
                free -= 32
        output = " & ".join([*chosen, *([f'"{"0" * free}"'] if free else [])])
        lines = [
            "library ieee;",
            "use ieee.std_logic_1164.all;",
            "use ieee.numeric_std.all;",
            "",
            f"entity {self.name} is",
            f"  port (clk, rst : in std_logic; x : in std_logic_vector({INPUT - 1} downto 0);",
            f"    y : out std_logic_vector({OUTPUT - 1} downto 0));",
            f"end entity {self.name};",
            "",
            f"architecture rtl of {self.name} is",
            *(f"  {line}" for line in (*self.types, *self.signals)),
            "begin",
            *(f"  {line}" for line in self.statements),
            f"  y <= {output};",
            "end architecture rtl;",
            "",
        ]
        return "\n".join(lines)

    # Names and declarations

    def fresh(self, letter: str) -> str:
        self.made += 1
        # Now and then a name that means something else in Verilog, or that GHDL's netlists use.
        name = self._fresh(letter)
        # Functions, types and named constants are static, and so are the indices of loops.
        if letter not in "gKTteklzi":
            self.dynamic.add(name)
        return name

    def _fresh(self, letter: str) -> str:
        if self.chance(0.03):
            return f"n{self.made}_o"
        if self.chance(0.03) and (words := [word for word in _WORDS if word not in self._words]):
            self._words.append(self.random.choice(words))
            return self._words[-1]
        return f"{letter}{self.made}"

    def depth(self) -> int:
        return self.random.choice([1, 2, 2, 3])

    def new_vector(self, letter: str = "s", width: int | None = None, kind: str | None = None) -> Vector:
        return Vector(
            self.fresh(letter),
            kind or self.random.choice(KINDS),
            width or self.width(),
            self.random.choice([0, 0, 0, 0, self.random.randint(1, 9)]),
            self.chance(0.15),
        )

    def signal(self, vector: Vector, first: str = "") -> None:
        self.signals.append(f"signal {vector.name} : {vector.kind}({vector.bounds}){first};")

    def process(self, sensitivity: list[str], declarations: list[str], body: list[str]) -> None:
        self.statements += [
            f"process ({', '.join(dict.fromkeys(sensitivity))})",
            *(f"  {line}" for line in declarations),
            "begin",
            *(f"  {line}" for line in body),
            "end process;",
        ]

    def everything(self) -> list[str]:
        """All signals: a sensitivity list that is never too short."""
        return ["rst", "x", *(line.split()[1] for line in (*self.types, *self.signals) if line.startswith("signal "))]

    # Concurrent statements

    def _assignment(self) -> None:
        if self.chance(0.2):
            self._gain()
        vector = self.new_vector()
        self.signal(vector)
        self.statements.append(
            f"{vector.name} <= {self.vector(self.scope, vector.kind, vector.width, self.depth() + 1)};"
        )
        self.scope.vectors.append(vector)
        if self.chance(0.2):
            bit = self.fresh("b")
            self.signals.append(f"signal {bit} : std_logic;")
            self.statements.append(f"{bit} <= {self.bit(self.scope, 2)};")
            self.scope.bits.append(bit)
        if self.chance(0.2):
            flag = self.fresh("f")
            self.signals.append(f"signal {flag} : boolean;")
            self.statements.append(f"{flag} <= {self.condition(self.scope, 2)};")
            self.scope.booleans.append(flag)

    def _gain(self) -> None:
        """A named constant, and a product with it."""
        kind, width, other = self.random.choice(KINDS[:2]), self.width(96), self.width(32)
        # Left out: a product of up to 64 bits with a constant of more than 32, at which GHDL 2.0 crashes.
        width = width if width + other > 64 else min(width, 32)
        name, result = self.fresh("K"), self.new_vector("s", width + other, kind)
        self.types.append(f"constant {name} : {kind}({width - 1} downto 0) := {self.literal(kind, width)};")
        self.signal(result)
        self.statements.append(f"{result.name} <= {self.operand(self.scope, kind, other, self.depth())} * {name};")
        self.scope.vectors += [Vector(name, kind, width), result]

    def _conditional(self) -> None:
        vector = self.new_vector()
        self.signal(vector)
        lines = []
        for _ in range(self.random.randint(1, 4)):
            value, condition = (
                self.vector(self.scope, vector.kind, vector.width, self.depth()),
                self.condition(self.scope, 2),
            )
            lines.append(f"{value} when {condition} else")
        lines.append(f"{self.vector(self.scope, vector.kind, vector.width, 1)};")
        self.statements.append(f"{vector.name} <= " + "\n    ".join(lines))
        self.scope.vectors.append(vector)

    def _selected(self) -> None:
        vector = self.new_vector()
        width = self.random.randint(1, 6)
        selector = self.new_vector("c", width, "std_logic_vector")
        self.signal(vector)
        self.signal(selector)
        self.statements.append(f"{selector.name} <= {self.vector(self.scope, selector.kind, width, 2)};")
        value: Callable[[], str] = lambda: self.vector(self.scope, vector.kind, vector.width, self.depth())  # noqa: E731
        choices = [f"{value()} when {choice}," for choice in self.choices(width)]
        self.statements.append(
            "\n    ".join([f"with {selector.name} select {vector.name} <=", *choices, f"{value()} when others;"])
        )
        self.scope.vectors += [vector, selector]

    def choices(self, width: int) -> list[str]:
        """Choices of a case on bits, not all of them."""
        values = self.random.sample(range(1 << width), self.random.randint(1, min(8, (1 << width) - 1)))
        words = [f'"{value:0{width}b}"' for value in values]
        if len(words) > 2 and self.chance(0.5):
            words = [f"{words[0]} | {words[1]}", *words[2:]]
        return words

    # Sequential statements

    def sequence(self, scope: Scope, targets: list[Target], depth: int) -> list[str]:
        """Statements that assign some of the targets."""
        lines: list[str] = []
        for _ in range(self.random.randint(1, 3)):
            lines += self._sequential(scope, targets, depth)
        return lines

    def _sequential(self, scope: Scope, targets: list[Target], depth: int) -> list[str]:
        kind = self.random.random()
        if depth <= 0 or kind < 0.45:
            return [self.assign(scope, self.random.choice(targets))]
        if kind < 0.7:
            return self._if(scope, targets, depth)
        if kind < 0.9:
            return self._case(scope, targets, depth)
        return self._loop(scope, targets)

    def assign(self, scope: Scope, target: Target) -> str:
        """An assignment to all of a target, to a part of it, or to a bit by a dynamic index."""
        vector, sign = target.vector, target.sign
        kind = self.random.random()
        if kind < 0.15 and vector.width > 1:
            width = self.random.randint(1, vector.width)
            part = vector.part(self.random.randint(0, vector.width - width), width)
            return f"{part} {sign} {self.moving(scope, vector.kind, width, self.depth(), sign == ':=')};"
        if kind < 0.3 and target.may_be_memory and vector.width > 1:
            return f"{vector.name}({self.index(scope, vector, 2)}) {sign} {self.bit(scope, 2)};"
        return f"{vector.name} {sign} {self.moving(scope, vector.kind, vector.width, self.depth(), sign == ':=')};"

    def moving(self, scope: Scope, kind: str, width: int, depth: int, is_variable: bool = True) -> str:
        """A value that GHDL does not know: of a variable, it would evaluate what is made of it.

        Left out: a signal that is a constant in one branch, while others assign parts of it. GHDL 2.0 takes the bits of
        the constant from the wrong end, so all of them are equal here.
        """
        if not is_variable and self.chance(0.15):
            return self.uniform(kind, width)
        found = self.vector(scope, kind, width, depth)
        return self.input(kind, scope, width) if self.is_static(found) else found

    def uniform(self, kind: str, width: int) -> str:
        """A constant whose bits are equal."""
        return f'{kind}\'("{self.random.choice("01") * width}")'

    def _if(self, scope: Scope, targets: list[Target], depth: int) -> list[str]:
        lines = [f"if {self.condition(scope, 2)} then", *self._indented(scope, targets, depth)]
        while self.chance(0.3):
            lines += [f"elsif {self.condition(scope, 2)} then", *self._indented(scope, targets, depth)]
        if self.chance(0.5):
            lines += ["else", *self._indented(scope, targets, depth)]
        return [*lines, "end if;"]

    def _indented(self, scope: Scope, targets: list[Target], depth: int) -> list[str]:
        return [f"  {line}" for line in self.sequence(scope, targets, depth - 1)]

    def _case(self, scope: Scope, targets: list[Target], depth: int) -> list[str]:
        vector = self.random.choice(scope.vectors)
        width = min(vector.width, self.random.randint(1, 5))
        selector = vector.part(self.random.randint(0, vector.width - width), width)
        choices = self.choices(width)
        if self.chance(0.3):
            selector, choices = self._integer_case(scope)
        lines = [f"case {selector} is"]
        for choice in choices:
            lines += [f"  when {choice} =>", *(f"  {line}" for line in self._indented(scope, targets, depth))]
        rest = self._indented(scope, targets, depth) if self.chance(0.8) else ["  null;"]
        return [*lines, "  when others =>", *(f"  {line}" for line in rest), "end case;"]

    def _integer_case(self, scope: Scope) -> tuple[str, list[str]]:
        width = self.random.randint(2, 6)
        kind = self.random.choice(KINDS[:2])
        low, high = (0, 2**width) if kind == "unsigned" else (-(2 ** (width - 1)), 2 ** (width - 1))
        values = sorted(self.random.sample(range(low, high), self.random.randint(2, 4)))
        if len(values) == 4 and self.chance(0.5):
            choices = [f"{values[0]} to {values[1]}", f"{values[2]} | {values[3]}"]
        else:
            choices = list(map(str, values))
        return f"to_integer({self.typed(scope, kind, width, 1)})", choices

    def _loop(self, scope: Scope, targets: list[Target]) -> list[str]:
        vector = self.random.choice(targets).vector
        sign = next(target.sign for target in targets if target.vector == vector)
        source = self.random.choice([item for item in scope.vectors if item.width >= 1])
        index = self.fresh("i")
        size = min(source.width, vector.width, 20)
        direction = self.random.choice([f"0 to {size - 1}", f"{size - 1} downto 0"])
        from_, to = f"{source.name}({source.low} + {index})", f"{vector.name}({vector.low} + {index})"
        lines = [f"for {index} in {direction} loop"]
        if self.chance(0.3):
            lines.append(f"  {self.random.choice(['exit', 'next'])} when {from_} = '{self.random.choice('01')}';")
        if self.chance(0.3):
            lines.append(f"  if {index} mod 3 = 1 then")
            lines.append(f"    {to} {sign} not {from_};")
            lines.append("  end if;")
        else:
            lines.append(f"  {to} {sign} {from_} {self.random.choice(['and', 'xor', 'or'])} {self.bit(scope, 1)};")
        return [*lines, "end loop;"]

    # Processes

    def _logic(self) -> None:
        """A process without a clock, some of its results by variables."""
        vectors = [self.new_vector() for _ in range(self.random.randint(1, 3))]
        variables = [self.new_vector("v") for _ in range(self.random.randint(0, 2))]
        for vector in vectors:
            self.signal(vector)
        scope = self.scope.inner()
        body = [f"{vector.name} := {self.moving(scope, vector.kind, vector.width, 1)};" for vector in variables]
        scope.vectors += variables
        body += [f"{vector.name} <= {self.moving(scope, vector.kind, vector.width, 1, False)};" for vector in vectors]
        targets = [*map(Target, vectors), *(Target(vector, ":=") for vector in variables)]
        body += self.sequence(scope, targets, 2)
        # What variables hold at the end is seen.
        for vector in variables:
            if self.chance(0.7):
                result = Vector(self.fresh("s"), vector.kind, vector.width)
                self.signal(result)
                body.append(f"{result.name} <= {vector.name};")
                vectors.append(result)
        declarations = [f"variable {vector.name} : {vector.kind}({vector.bounds});" for vector in variables]
        self.process(self.everything(), declarations, body)
        self.scope.vectors += vectors

    def _registers(self) -> None:
        vectors = [self.new_vector("r") for _ in range(self.random.randint(1, 3))]
        reset = self.random.choice(["none", "synchronous", "asynchronous"])
        # For the reason in `moving`.
        value_of_reset = self.uniform if reset == "synchronous" else self.literal
        resets = [f"{vector.name} <= {value_of_reset(vector.kind, vector.width)};" for vector in vectors]
        # Without a first value and before the first edge, others would read what is not defined, for good.
        has_first = reset != "asynchronous" or self.chance(0.3)
        for vector in vectors:
            self.signal(vector, f" := {self.literal(vector.kind, vector.width)}" if has_first else "")
        scope = self.scope.inner()
        scope.vectors += vectors
        variables: list[Vector] = []
        body: list[str] = []
        if self.chance(0.3):
            variables = [self.new_vector("v")]
            body = [f"{vector.name} := {self.moving(scope, vector.kind, vector.width, 1)};" for vector in variables]
            scope.vectors += variables
        targets = [Target(vector, may_be_memory=reset == "asynchronous") for vector in vectors]
        targets += [Target(vector, ":=") for vector in variables]
        body += self.sequence(scope, targets, 2)
        # What is never assigned but in a reset is no register.
        for vector in vectors:
            value = self.input(vector.kind, self.scope, vector.width)
            body += [f"if {self.condition(scope, 1)} then", f"  {vector.name} <= {value};", "end if;"]
        edge = (
            "rising_edge(clk)"
            if self.chance(0.8)
            else self.random.choice(["falling_edge(clk)", "clk'event and clk = '1'"])
        )
        if reset == "synchronous":
            body = [
                "if rst = '1' then",
                *(f"  {line}" for line in resets),
                "else",
                *(f"  {line}" for line in body),
                "end if;",
            ]
        if reset == "asynchronous":
            body = [
                "if rst = '1' then",
                *(f"  {line}" for line in resets),
                f"elsif {edge} then",
                *(f"  {line}" for line in body),
                "end if;",
            ]
        else:
            body = [f"if {edge} then", *(f"  {line}" for line in body), "end if;"]
        self.process(["clk", "rst"], [f"variable {v.name} : {v.kind}({v.bounds});" for v in variables], body)
        self.scope.vectors += vectors

    # Memories and arrays

    def array_type(self, depth: int, kind: str, width: int) -> str:
        name = self.fresh("t")
        self.types.append(f"type {name} is array (0 to {depth - 1}) of {kind}({width - 1} downto 0);")
        return name

    def contents(self, kind: str, width: int, depth: int) -> str:
        """Words of a memory, which GHDL makes one constant of."""
        values = [self.pattern(width) for _ in range(depth)]
        # Left out: a memory whose last word alone is other than zero, in GHDL's order of words.
        values[-1] |= 1
        return "(" + ", ".join(f'{index} => "{value:0{width}b}"' for index, value in enumerate(values)) + ")"

    def _memory(self) -> None:
        depth, width, kind = self.random.choice([2, 4, 8, 16, 5, 11]), self.width(40), self.random.choice(KINDS)
        type_ = self.array_type(depth, kind, width)
        ram = self.fresh("m")
        first = self.contents(kind, width, depth)
        result = Vector(self.fresh("q"), kind, width)
        write, read = self.below(self.scope, depth, 2), self.below(self.scope, depth, 2)
        data = self.vector(self.scope, kind, width, 2)
        enable = self.condition(self.scope, 1)
        is_variable = self.chance(0.3)
        sign = ":=" if is_variable else "<="
        body = [f"if {enable} then", f"  {ram}({write}) {sign} {data};", "end if;"]
        declaration = f"{ram} : {type_} := {first};"
        style = self.random.choice(["before", "after", "asynchronous", "enabled"])
        value = f"{ram}({read})"
        if style == "asynchronous" and not is_variable:
            self.statements.append(f"{result.name} <= {value};")
            self.signal(result)
        else:
            self.signal(result, f" := {self.literal(kind, width)}")
            reading = [f"{result.name} <= {value};"]
            if style == "enabled":
                reading = [f"if {self.condition(self.scope, 1)} then", f"  {reading[0]}", "end if;"]
            body = [*reading, *body] if style == "before" else [*body, *reading]
        if self.chance(0.2):
            other = self.below(self.scope, depth, 1)
            body += [
                f"if {self.condition(self.scope, 1)} then",
                f"  {ram}({other}) {sign} {self.vector(self.scope, kind, width, 1)};",
                "end if;",
            ]
        if not is_variable:
            self.types.append(f"signal {declaration}")
        self.process(
            ["clk"],
            [f"variable {declaration}"] if is_variable else [],
            ["if rising_edge(clk) then", *(f"  {line}" for line in body), "end if;"],
        )
        self.scope.vectors.append(result)

    def _table(self) -> None:
        depth, width, kind = self.random.randint(2, 24), self.width(70), self.random.choice(KINDS)
        type_ = self.array_type(depth, kind, width)
        table = self.fresh("T")
        self.types.append(f"constant {table} : {type_} := {self.contents(kind, width, depth)};")
        result = Vector(self.fresh("q"), kind, width)
        self.signal(result)
        self.statements.append(f"{result.name} <= {table}({self.below(self.scope, depth, 2)});")
        self.scope.vectors.append(result)

    def _array(self) -> None:
        """Registers or variables in an array, by constant and by dynamic indices."""
        depth, width, kind = self.random.randint(2, 6), self.width(20), self.random.choice(KINDS)
        type_ = self.array_type(depth, kind, width)
        name, result = self.fresh("a"), Vector(self.fresh("s"), kind, width)
        fixed = Vector(self.fresh("s"), kind, width)
        value: Callable[[], str] = lambda: self.vector(self.scope, kind, width, 2)  # noqa: E731
        place: Callable[[], str] = lambda: self.below(self.scope, depth, 2)  # noqa: E731
        self.signal(result)
        self.signal(fixed)
        reads = [f"{result.name} <= {name}({place()});", f"{fixed.name} <= {name}({self.random.randrange(depth)});"]
        if self.chance(0.5):
            # Left out: reading by a constant index what is written by a dynamic one; the translation refuses it.
            reads[1] = f"{fixed.name} <= {name}({place()});"
            self.types.append(f"signal {name} : {type_} := (others => {self.literal(kind, width)});")
            body = [
                "if rising_edge(clk) then",
                f"  if {self.condition(self.scope, 1)} then",
                f"    {name}({place()}) <= {value()};",
            ]
            if self.chance(0.5):
                body += ["  else", f"    {name}({self.random.randrange(depth)}) <= {value()};"]
            self.process(["clk"], [], [*body, "  end if;", "end if;"])
            self.statements += reads
        else:
            body = [f"for i in 0 to {depth - 1} loop", f"  {name}(i) := {value()};", "end loop;"]
            body += [f"{name}({place()}) := {value()};", f"if {self.condition(self.scope, 1)} then"]
            body += [f"  {name}({place()}) := {value()};", "end if;", *reads]
            self.process(self.everything(), [f"variable {name} : {type_};"], body)
        self.scope.vectors += [result, fixed]

    # Functions, other types, generated statements

    def _function(self) -> None:
        name, kind = self.fresh("g"), self.random.choice(KINDS)
        argument = Vector("p", kind, self.width(40))
        result = self.new_vector()
        local = Vector("o", result.kind, result.width)
        scope = Scope([argument], [Integer("n", 0, 7)])
        body = [f"o := {self.moving(scope, local.kind, local.width, 2)};"]
        scope.vectors.append(local)
        body += self.sequence(scope, [Target(local, ":=")], 2)
        if self.chance(0.3):
            body += [f"if {self.condition(scope, 1)} then", "  return o;", "end if;"]
            body += [f"o := {self.moving(scope, local.kind, local.width, 1)};"]
        self.types += [
            f"function {name}(p : {kind}({argument.bounds}); n : natural) return {result.kind} is",
            f"  variable o : {local.kind}({local.bounds});",
            "begin",
            *(f"  {line}" for line in body),
            "  return o;",
            f"end function {name};",
        ]
        self.signal(result)
        given = self.moving(self.scope, kind, argument.width, 2)
        self.statements.append(f"{result.name} <= {name}({kind}'({given}), {self.below(self.scope, 8, 1)});")
        self.scope.vectors.append(result)

    def _enumeration(self) -> None:
        """A state machine and what it puts out."""
        name, state, size = self.fresh("e"), self.fresh("y"), self.random.randint(2, 9)
        words = [f"{name}_{number}" for number in range(size)]
        self.types += [
            f"type {name} is ({', '.join(words)});",
            f"signal {state} : {name} := {self.random.choice(words)};",
        ]
        body = [f"case {state} is"]
        shown = self.random.sample(words, self.random.randint(1, size - 1))
        for word in shown:
            body += [f"  when {word} =>", f"    if {self.condition(self.scope, 1)} then"]
            body += [f"      {state} <= {self.random.choice(words)};", "    else"]
            body += [f"      {state} <= {self.random.choice(words)};", "    end if;"]
        body += ["  when others =>", f"    {state} <= {self.random.choice([shown[0], words[0]])};", "end case;"]
        self.process(["clk"], [], ["if rising_edge(clk) then", *(f"  {line}" for line in body), "end if;"])
        result = self.new_vector()
        self.signal(result)
        value: Callable[[], str] = lambda: self.vector(self.scope, result.kind, result.width, 1)  # noqa: E731
        self.statements.append(
            "\n    ".join(
                [
                    f"with {state} select {result.name} <=",
                    *(f"{value()} when {word}," for word in words[: size - 1]),
                    f"{value()} when others;",
                ]
            )
        )
        self.scope.booleans.append(f"({state} = {self.random.choice(words)})")
        if self.chance(0.5):
            self.scope.integers.append(Integer(f"{name}'pos({state})", 0, size - 1))
        self.scope.vectors.append(result)

    def _record(self) -> None:
        name, signal = self.fresh("k"), self.fresh("w")
        fields = [
            Vector(f"f{number}", self.random.choice(KINDS), self.width(40))
            for number in range(self.random.randint(2, 3))
        ]
        self.types += [
            f"type {name} is record",
            *(f"  {item.name} : {item.kind}({item.bounds});" for item in fields),
            "end record;",
        ]
        first = ", ".join(f"{item.name} => {self.literal(item.kind, item.width)}" for item in fields)
        self.types.append(f"signal {signal} : {name} := ({first});")
        value: Callable[[Vector], str] = lambda item: self.vector(self.scope, item.kind, item.width, 2)  # noqa: E731
        aggregate = ", ".join(f"{item.name} => {value(item)}" for item in fields)
        body = [
            "if rising_edge(clk) then",
            f"  if {self.condition(self.scope, 1)} then",
            f"    {signal} <= ({aggregate});",
            "  else",
        ]
        body += [f"    {signal}.{item.name} <= {value(item)};" for item in fields[:-1]]
        self.process(["clk"], [], [*body, "  end if;", "end if;"])
        self.scope.vectors += [Vector(f"{signal}.{item.name}", item.kind, item.width) for item in fields]

    def _integer_signal(self) -> None:
        name, found = self.fresh("j"), self.integer(self.scope, 3)
        # Left out: a range of one number, at which GHDL 2.0 crashes.
        low, high = min(found.low, 0), max(found.high, 1)
        self.signals.append(f"signal {name} : integer range {low} to {high} := 0;")
        if self.chance(0.5):
            self.statements.append(f"{name} <= {found.text};")
        else:
            self.process(["clk"], [], ["if rising_edge(clk) then", f"  {name} <= {found.text};", "end if;"])
        self.scope.integers.append(Integer(name, low, high))

    def _generated(self) -> None:
        vector = self.new_vector(width=self.random.randint(2, 30))
        self.signal(vector)
        label, index = self.fresh("l"), self.fresh("i")
        source = self.random.choice(self.scope.vectors)
        place = f"{source.low} + ({index} mod {source.width})"
        self.statements += [
            f"{label} : for {index} in {vector.low} to {vector.low + vector.width - 1} generate",
            f"  {vector.name}({index}) <= {source.name}({place}) xor {self.bit(self.scope, 1)};",
            "end generate;",
        ]
        self.scope.vectors.append(vector)


_WORDS = ("reg", "wire", "logic", "byte", "assign", "initial", "int", "endmodule", "posedge", "module")
