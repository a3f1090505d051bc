"""Random statements of processes in VHDL, and names for what they need. "Left out": see designs.py."""

from __future__ import annotations

from dataclasses import dataclass
from random import Random

from tests.netlist.expressions import KINDS, Expressions, Scope, Vector

_WORDS = ("reg", "wire", "logic", "byte", "assign", "initial", "int", "endmodule", "posedge", "module")


@dataclass(frozen=True)
class Target:
    """A signal or variable that a process assigns."""

    vector: Vector
    sign: str = "<="
    # Left out: a register whose bits are written by a dynamic index and read by constant ones. GHDL 2.0 takes it for a
    # memory and loses it; the translation sees that and does without memories, all of them.
    may_be_memory: bool = True


class Statements(Expressions):
    """Random statements that assign targets."""

    def __init__(self, random: Random) -> None:
        super().__init__(random)
        self.made = 0
        self._words: list[str] = []

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

    def choices(self, width: int) -> list[str]:
        """Choices of a case on bits, not all of them."""
        values = self.random.sample(range(1 << width), self.random.randint(1, min(8, (1 << width) - 1)))
        words = [f'"{value:0{width}b}"' for value in values]
        if len(words) > 2 and self.chance(0.5):
            words = [f"{words[0]} | {words[1]}", *words[2:]]
        return words

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
        value = self.moving(scope, vector.kind, vector.width, self.depth(), sign == ":=")
        # Left out: what a target has already. Behind a conditional assignment, GHDL 2.0 confuses the two.
        value = self.input(vector.kind, scope, vector.width) if value == vector.name else value
        return f"{vector.name} {sign} {value};"

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
