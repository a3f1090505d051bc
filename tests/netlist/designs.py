"""Random VHDL that synthesis takes: expressions and processes on `signed`, `unsigned` and integers.

A design is an entity with a clock, a reset, an input of 128 bits and an output of up to 128. Whatever it computes is
defined: nothing is divided by zero, no index and no integer leaves its range, and each register has a first value or a
reset. So GHDL's simulation is right by definition, and a netlist must say the same.

What is left out on purpose, as GHDL 2.0 synthesises it wrongly or not at all and a netlist does not show it, is listed
in docs/reference/netlist.md and marked with "Left out" here and in the modules that this one imports.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from random import Random

from tests.netlist.expressions import KINDS, Integer, Scope, Vector
from tests.netlist.statements import Statements, Target

INPUT = OUTPUT = 128


@dataclass(frozen=True)
class Design:
    """An entity and its architecture."""

    name: str
    seed: str
    text: str


def design(name: str, seed: str) -> Design:
    """The design of a seed."""
    return _Maker(name, Random(seed)).design(seed)


class _Maker(Statements):
    """Makes one architecture, a block after the other; each may read what those before it have made."""

    def __init__(self, name: str, random: Random) -> None:
        super().__init__(random)
        self.name = name
        self.scope = Scope([Vector("x", "std_logic_vector", INPUT)])
        self.types: list[str] = []
        self.signals: list[str] = []
        self.statements: list[str] = []

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

    # Declarations

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
