"""Random functions within the language that is compiled, whose results Python computes as well."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field

_COMPARISONS = ("<", "<=", ">", ">=", "==", "!=")
# None of them is known to be zero, which is refused.
_DIVISORS = ("m.i", "m.j", "(self.n + m.j)", "10", "-7")


@dataclass
class RandomFunction:
    """A function `name` of a message of tests.compiler.compiled, with a state."""

    source: random.Random
    name: str
    lines: list[str] = field(default_factory=list)
    floats: list[str] = field(default_factory=lambda: ["m.a", "m.b", "m.v[0]", "m.v[1]", "self.x"])
    singles: list[str] = field(default_factory=lambda: ["m.c", "m.d", "self.y"])
    integers: list[str] = field(default_factory=lambda: ["m.i", "m.j", "self.n"])
    bools: list[str] = field(default_factory=lambda: ["m.p", "m.q"])
    # The largest constants; fixed-point numbers hold less than floats do.
    large: str = "1e6"
    huge: str = "1e300"
    divisions: int = 0
    angles: int = 0

    def text(self) -> str:
        """Return the source."""
        for _ in range(self.source.randint(2, 6)):
            self.statement(2)
        body = "\n".join(f"        {line}" for line in self.lines)
        return f"""import math
import numpy as np


def limited(x, low, high={self.large}):
    return low if x < low else high if x > high else x


class Random:
    def __init__(self):
        self.x = {self.source.choice(["0.0", "-1.5", self.huge])}
        self.y = np.float32({self.source.choice(["0.0", "2.5"])})
        self.n = np.int32({self.source.randint(-5, 5)})

    def __call__(self, m):
{body}
        self.x = {self.float_(2)}
        self.y = {self.single(1)}
        self.n = {self.integer(1)}
        return {{
            "a": {self.float_(2)}, "b": {self.float_(1)}, "c": {self.single(2)}, "d": {self.single(1)},
            "i": {self.integer(2)}, "j": {self.integer(1)}, "k": {self.integer(1)}, "n": int({self.float_(1)}),
            "p": {self.condition(2)}, "q": {self.condition(1)}, "v": [{self.float_(1)}, m.v[m.k % 2], {self.float_(0)}],
            "w": [m.w[{self.source.randint(0, 3)}], m.w[m.i & 3], {self.integer(0)}, round(m.c)],
        }}


{self.name} = Random()
"""

    def statement(self, depth: int) -> None:
        """Add a statement to the body."""
        choices: list[Callable[[int], None]] = [self._assign, self._assign, self._if, self._loop, self._return]
        self.source.choice(choices)(depth)

    def _add(self, line: str, depth: int) -> None:
        self.lines.append("    " * (2 - depth) + line)

    def _assign(self, depth: int) -> None:
        names, make = self.source.choice(
            [(self.floats, self.float_), (self.singles, self.single), (self.integers, self.integer)]
        )
        name = f"t{len(self.floats)}_{len(self.singles)}_{len(self.integers)}_{len(self.lines)}"
        value = make(2)
        self._add(f"{name} = {value}", depth)
        if depth == 2:
            names.append(name)

    def _if(self, depth: int) -> None:
        if depth == 0:
            self._assign(depth)
            return
        targets = [
            (name, make)
            for names, make in ((self.floats, self.float_), (self.integers, self.integer))
            for name in names
            if name[0] in "ts" and name != "self.n"
        ]
        if not targets:
            self._assign(depth)
            return
        name, make = self.source.choice(targets)
        self._add(f"if {self.condition(2)}:", depth)
        self._add(f"    {name} = {make(1)}", depth)
        if self.source.random() < 0.5:
            self._add(f"elif {self.condition(1)}:", depth)
            self._add(f"    {name} = {make(1)}", depth)
        if self.source.random() < 0.3:
            self._add("else:", depth)
            self._add(f"    {name} {self.source.choice(['+=', '-='])} {make(0)}", depth)

    def _loop(self, depth: int) -> None:
        name = f"s{len(self.lines)}"
        self._add(f"{name} = 0.0", depth)
        self._add("for k in range(3):", depth)
        if self.source.random() < 0.5:
            self._add(f"    if m.v[k] {self.source.choice(_COMPARISONS)} {self.float_(0)}:", depth)
            self._add(f"        {self.source.choice(['continue', 'break'])}", depth)
        self._add(f"    {name} = {name} + m.v[k] * {self.source.choice(['k', '0.5', 'm.a'])}", depth)
        if depth == 2:
            self.floats.append(name)

    def _return(self, depth: int) -> None:
        if self.source.random() < 0.3:
            self._add(f"if {self.condition(1)}:", depth)
            self._add(
                f"    return {self.source.choice(['None', '{{**m}}', '{{}}']).replace('{{', '{').replace('}}', '}')}",
                depth,
            )

    def float_(self, depth: int) -> str:
        """Return an expression of the kind float64."""
        if depth == 0:
            return self.source.choice(self.floats) if self.source.random() < 0.8 else self._constant("np.float64")
        one = self.float_(depth - 1)
        other = self.float_(depth - 1) if self.source.random() < 0.8 else self._constant("")
        draw = self.source.randrange(13)
        if draw == 0 and self.divisions < 2:
            self.divisions += 1
            return f"({one} / {other})"
        if draw == 1 and self.divisions < 2:
            self.divisions += 1
            return f"math.sqrt(abs({one}))"
        if draw == 12 and self.angles < 2:
            self.angles += 1
            return f"{self.source.choice(['math.sin', 'math.cos', 'math.tan', 'np.sin', 'np.cos'])}({one})"
        forms = {
            2: f"max({one}, {other})",
            3: f"min({one}, {other})",
            4: f"(-{one})",
            5: f"({one} if {self.condition(depth - 1)} else {other})",
            6: f"limited({one}, {other})",
            7: f"np.float64({self.integer(depth - 1)})",
            8: f"({one} ** 2)",
            9: f"math.copysign({one}, {other})",
            10: f"(({self.single(0)} if {self.condition(0)} else {one}) {self.source.choice('+-*')} m.a)",
        }
        return forms.get(draw, f"({one} {self.source.choice('+-*')} {other})")

    def single(self, depth: int) -> str:
        """Return an expression of the kind float32."""
        if depth == 0:
            return self.source.choice(self.singles) if self.source.random() < 0.8 else self._constant("np.float32")
        one = self.single(depth - 1)
        other = self.single(depth - 1) if self.source.random() < 0.7 else self._constant("")
        forms = [f"({one} {sign} {other})" for sign in "+-*"]
        forms += [
            f"abs({one})",
            f"max({one}, {self.single(0)})",
            f"np.float32({self.float_(depth - 1)})",
            f"({one} * 4.0 / 8.0)",
        ]
        if self.angles < 2 and self.source.random() < 0.1:
            self.angles += 1
            return f"{self.source.choice(['np.sin', 'np.cos', 'np.tan', 'math.sin'])}({one})"
        return self.source.choice(forms)

    def integer(self, depth: int) -> str:
        """Return an expression of the kind int32."""
        if depth == 0:
            return (
                self.source.choice(self.integers)
                if self.source.random() < 0.8
                else f"np.int32({self.source.randint(-99, 99)})"
            )
        one, other = self.integer(depth - 1), self.integer(depth - 1)
        forms = [f"({one} {sign} {other})" for sign in "+-*&|^"]
        forms += [
            f"({one} >> {self.source.randint(0, 9)})",
            f"({one} << {self.source.randint(0, 9)})",
            f"({one} // 8)",
            f"({one} % 16)",
            f"({one} // {self.source.choice(_DIVISORS)})",
            f"({one} % {self.source.choice(_DIVISORS)})",
        ]
        forms += [
            f"max({one}, {other})",
            f"({one} if {self.condition(depth - 1)} else {other})",
            f"(~{one})",
            f"(({self.source.choice(['m.k', 'm.w[0]', 'm.q'])} if {self.condition(0)} else {one}) * {other})",
            f"np.int32(m.k + {self.source.randint(0, 3)})",
        ]
        return self.source.choice(forms)

    def condition(self, depth: int) -> str:
        """Return an expression of truth."""
        if depth == 0:
            return self.source.choice(self.bools)
        comparison = self.source.choice(_COMPARISONS)
        make = self.source.choice([self.float_, self.single, self.integer])
        forms = [
            f"{make(depth - 1)} {comparison} {make(0)}",
            f"({self.condition(depth - 1)} and {self.condition(0)})",
            f"({self.condition(depth - 1)} or {self.condition(0)})",
            f"(not {self.condition(depth - 1)})",
            f"({self.integer(0)} {comparison} m.n)",
            f"(m.w[1] if {self.condition(0)} else {self.float_(0)}) {comparison} (m.k if m.p else {self.integer(0)})",
            f"(-1.5 < {self.float_(0)} <= 3.0)",
            f"math.isnan({self.float_(0)})",
        ]
        return self.source.choice(forms)

    def _constant(self, kind: str) -> str:
        value = self.source.choice(["0.5", "2.0", "-3.25", "0.1", "1e-3", "0.0"])
        return f"{kind}({value})" if kind else value
