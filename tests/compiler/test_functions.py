"""Compiled functions answer as Python and NumPy do, to the bit."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from fusesoc_firm.compiler.binding import bound
from fusesoc_firm.compiler.fixed import MOST_BITS
from fusesoc_firm.compiler.writer import Writer
from fusesoc_firm.text.diagnostics import InputError
from tests.compiler.compiled import Unit, differences, message_frame, random_messages, simulated
from tests.compiler.random_functions import RandomFunction

_SEED = 7
_FUNCTIONS = {
    "plain": """
def plain(m):
    return {
        "a": m.a * 2.0 + m["b"], "b": m.a - 0.0, "c": m.c - m.d, "d": m.c / 8.0, "i": m.i + m.j, "k": m.k + 1,
        "p": m.p and not m.q, "q": m.a < m.b, "v": [m.v[2], -m.v[1], abs(m.v[0])],
    }
""",
    "control": """
import math

GAIN = 2.5


def helper(x, y=1.0):
    return x * y if x > y else y - x


def control(m):
    s = 0.0
    for i in range(3):
        if m.v[i] > 100.0:
            continue
        s = s + m.v[i] * GAIN
    t = 0
    for x in m.w:
        if x < 0:
            break
        t = t + x
    if m.p:
        return None
    return {
        "a": s, "b": math.sqrt(abs(m.b)), "c": m.c / (m.d + 3.0), "d": helper(m.c), "i": int(m.a), "j": t,
        "k": m.i % 16, "n": round(m.b), "q": m.i > m.n or m.j == m.k,
        "v": [math.copysign(m.a, m.v[1] - m.v[1]), math.copysign(m.v[2], -m.a), 0.0],
        "w": [m.w[m.k & 3], m.w[0] >> 2, m.i << 1, m.j // 4],
    }
""",
    "divided": """
def divided(m):
    return {
        "i": m.i // m.j, "j": m.i % m.j, "k": m.k // 7 + m.k % 10, "n": m.n // m.i, "a": float(m.n % (m.k - 100)),
        "b": divmod_(int(m.c), m.n), "w": [m.w[0] // m.w[1], m.w[0] % m.w[1], m.w[2] // -3, m.w[3] % -1],
    }


def divmod_(a, b):
    return a // b * 1000.0 + a % b
""",
    "limits": """
import math


def limits(m):
    return {
        "a": max(m.a, m.v[0], m.b, m.v[1]), "b": min(m.v[0], m.b, m.v[1], m.a), "c": max(m.c, 0.0), "d": min(m.d, m.c),
        "p": m.v[0] < -m.v[0], "q": math.fma(m.c, m.d, 0.1) <= -m.c, "n": int(math.fma(m.a, m.b, m.v[0])),
        "v": [max(m.v[2], -m.v[2]), min(m.v[2], -m.v[2]), m.v[0]],
    }
""",
    # What is computed with the first value of a state is not a constant that may be refused.
    "begun": """
class Begun:
    def __init__(self):
        self.last = 0.0
        self.past = [0, 1]
        self.parts = [2.0, 4]

    def __call__(self, m):
        answer = {"a": 1.0 / self.last, "b": m.a / self.past[0], "i": m.i // self.past[0], "v": [*self.parts, 0.0]}
        self.last = m.a
        self.past[0] += 1
        return answer


begun = Begun()
""",
    # A state is a constant at first, and not a number later.
    "beyond": """
import math


class Beyond:
    def __init__(self):
        self.x = 1e300

    def __call__(self, m):
        self.x = self.x * self.x - self.x * self.x
        return {
            "n": int(self.x), "a": float(int(1e30)), "b": float(math.floor(-1e30)), "w": [int(math.nan), 0, 0, 0],
            "v": [float(round(math.inf)), float(math.ceil(1e30)), self.x],
        }


beyond = Beyond()
""",
    # A value that is used again after its neighbours have appeared needs its own register.
    "reused": """
def reused(m):
    one, two, three = m.a + m.b, m.a + m.v[0], m.b + m.v[1]
    return {"a": one * two, "b": one * three, "v": [two * three, 0.0, 0.0]}
""",
    # Operations have the type that a name has on the path to them.
    "mixed": """
import math


def mixed(m):
    k, x, y, t = m.k, m.a, m.i, m.i
    if m.p:
        k, x, y = m.i, m.c, m.b
    elif m.q:
        x, t = 0.1, m.p
    n = m.n if m.q else k
    z = min(m.c, 1.2, m.v[0])
    if x < z:
        return {"a": 0.1, "b": m.c, "i": k, "j": 300, "k": n, "d": z, "w": [n, k, *m.w[:2]]}
    return {
        "a": x * m.b, "b": x * x, "c": z * m.d, "d": x, "i": k * k, "j": k + m.i, "k": -n, "n": max(n, m.i) << 1,
        "p": n > k, "q": not x, "v": [math.sqrt(abs(x)), y / 3, z * 0.1], "w": [m.w[k & 3], ~n, t + 3, int(y)],
    }
""",
    "state": """
class State:
    total = 0.0
    counts = [0, 0]

    def __init__(self):
        self.count = 0
        self.past = [0.0] * 3

    def __call__(self, m):
        self.count += 1
        self.counts[m.k & 1] += 2
        if m.q:
            return None
        self.total += m.a
        self.past = [m.c, self.past[0], self.past[1]]
        return {
            "a": self.total, "n": self.count, "v": self.past, "c": max(self.past[2], m.d), "i": self.counts[0],
            "j": self.counts[1],
        }


state = State()
""",
}

_QUOTIENTS = """
def quotients(m):
    return {"a": m.a / m.b, "b": m.b / m.v[0], "v": [m.b / m.a, m.v[0] / m.b, m.a - m.b]}
"""

_FIXED = {
    "filtered": """
import math
from math import pi

THIRD = 1 / 3
TWO_PI = 2 * math.pi


class Filter:
    def __init__(self):
        self.s = 0.0
        self.past = [0.0] * 3

    def __call__(self, m):
        self.s += 0.25 * m.a
        self.past = [m.c, *self.past[:2]]
        best = math.inf
        for x in m.v:
            if x < best:
                best = x
        return {
            "a": self.s, "b": m.a * m.b - m.c * THIRD + 2, "c": m.c / m.d, "d": pi - abs(m.d) - TWO_PI, "i": int(m.a),
            "j": round(m.b), "n": math.floor(m.c) * 1000 + math.ceil(m.d), "p": m.a < 100, "q": m.c >= m.d,
            "v": [best, max(m.v) * -4.0, m.a / 8.0 + m.i], "k": np_uint8(m.v[0]),
            "w": [int(m.v[1] * 2), round(m.v[2] / 4), int(sum(self.past)), m.p + 1],
        }


from numpy import uint8 as np_uint8

filtered = Filter()
""",
    "roots": """
import math


def roots(m):
    return {
        "a": math.sqrt(abs(m.a if m.q else m.w[0])), "b": m.b ** 0.5, "c": m.c ** 2.0 + m.i ** 2.0,
        "d": math.atan2(m.c, m.d),
        "v": [math.hypot(m.a, m.b), math.sin(m.c), 1 / m.d], "p": math.isinf(m.a), "q": math.isfinite(m.b),
    }
""",
}

_CONSTANTS = """
import math
import numpy as np

ANGLE = math.sin(1.1) * np.exp(np.float32(0.3)) + int(2.7)
THIRD = 7 // 3 + 2 ** 0.5


def constants(m):
    return {"a": ANGLE, "b": THIRD * m.a, "c": np.float32(ANGLE)}
"""

_ANGLES = """
import math
import numpy as np
from math import cos


def angles(m):
    return {
        "a": math.sin(m.a), "b": cos(m.a) + np.exp(m.d), "c": np.sin(m.c), "d": np.tan(m.c) - np.cos(np.float32(0.5)),
        "v": [math.tan(m.b), math.sin(m.i), -math.cos(m.b) * math.sin(2.0) + math.tan(0.3)],
        "p": math.isnan(np.cos(m.v[0])), "q": np.sin(m.j) > np.cos(m.v[1]),
    }
"""


def check(units: list[Unit], messages: int, folder: Path, seed: int) -> None:
    sent = random_messages(random.Random(seed), messages)
    found = simulated(units, sent, folder, seed)
    wrong = [text for unit in units for text in differences(unit, sent, unit.expected(sent, folder), found[unit])]
    assert not wrong, "\n".join(wrong[:3])


@pytest.mark.check
def test_functions_answer_as_python_does(tmp_path: Path) -> None:
    units = [Unit(name, text) for name, text in _FUNCTIONS.items()]
    # Both quotients are awaited in one step, and take longer with subnormal numbers.
    check([*units, Unit("quotients", _QUOTIENTS, limits={"divide": 2})], 40, tmp_path, _SEED)


@pytest.mark.check
def test_angles_have_the_results_of_the_models(tmp_path: Path) -> None:
    check([Unit("angles", _ANGLES)], 10, tmp_path, _SEED)


@pytest.mark.check
@pytest.mark.parametrize(
    ("functions", "messages", "seeds"),
    [(3, 20, range(1, 2)), pytest.param(10, 60, range(1, 101), marks=pytest.mark.thorough)],
)
def test_random_functions_answer_as_python_does(functions: int, messages: int, seeds: range, tmp_path: Path) -> None:
    for seed in seeds:
        source = random.Random(seed)
        units = [
            Unit(f"f{number}", RandomFunction(source, f"f{number}").text(), limits={"add": 1 + number % 2})
            for number in range(functions)
        ]
        folder = tmp_path / str(seed)
        folder.mkdir()
        check(units, messages, folder, seed)


@pytest.mark.check
@pytest.mark.parametrize("numbers", ["fixed(16, 8)", "fixed(48, 30)", "fixed(20, 0)", "fixed(9, 4)"])
def test_fixed_point_numbers_are_rounded_and_saturated(numbers: str, tmp_path: Path) -> None:
    names = ["filtered"] if numbers in ("fixed(20, 0)", "fixed(9, 4)") else [*_FIXED]
    check([Unit(name, _FIXED[name].replace("100", "10"), numbers) for name in names], 40, tmp_path, _SEED)


def test_constants_of_the_module_have_the_results_of_the_models(tmp_path: Path) -> None:
    unit, (message,) = Unit("constants", _CONSTANTS), random_messages(random.Random(1), 1)
    (answer,) = unit.program().answers
    (found,) = unit.expected([message], tmp_path)
    assert found
    values = {port: nodes[0] for port, nodes in answer.fields.items()}
    assert [values[f"out_{name}"].payload for name in "ac"] == [found["a"], found["c"]]


@pytest.mark.check
@pytest.mark.parametrize(
    ("functions", "messages", "seeds"),
    [(2, 20, range(1, 3)), pytest.param(10, 60, range(1, 31), marks=pytest.mark.thorough)],
)
def test_random_functions_of_fixed_point_numbers(functions: int, messages: int, seeds: range, tmp_path: Path) -> None:
    for seed in seeds:
        source = random.Random(seed)
        # The constants of the functions are below 100.
        width = source.randint(9, MOST_BITS)
        numbers = f"fixed({width}, {source.randint(0, width - 8)})"
        units = [_fixed_unit(source, number, numbers) for number in range(functions)]
        folder = tmp_path / str(seed)
        folder.mkdir()
        check(units, messages, folder, seed)


def _fixed_unit(source: random.Random, number: int, numbers: str) -> Unit:
    """A random function; one with a constant that the numbers do not hold is refused, and replaced by another one."""
    while True:
        text = RandomFunction(source, f"f{number}", large="7.5", huge="9").text()
        unit = Unit(f"f{number}", text, numbers, {"multiply": 1 + number % 2})
        try:
            unit.program()
        except InputError as error:
            if "is out of the range of" not in str(error):
                raise
        else:
            return unit


def test_an_operation_stays_as_it_is_written() -> None:
    """A sum is not reordered, and a product with a sum is not fused; equal operations are computed once."""
    text = "def f(m):\n    x = m.a + m.b + m.v[0]\n    y = m.b + m.a\n    return {'a': x, 'b': y * m.v[0] + x}\n"
    nodes = [str(node) for node in Unit("f", text).program().needed() if node.operation in ("add", "multiply")]
    assert [node.split(" = ")[1].partition("(")[0] for node in nodes] == ["add", "add", "multiply", "add"]


@pytest.mark.parametrize(
    ("expression", "operations"),
    [
        ("m.a / 8.0", ["multiply"]),
        ("m.a / 3.0", ["divide"]),
        ("m.a * 1.0", []),
        ("m.a * -1.0", ["negate"]),
        ("m.a + 0.0", ["add"]),
        ("m.a - 0.0", ["add"]),
        ("-(-m.a)", []),
        ("2.0 * 3.5", []),
        # As the product that the model computes: Python's power raises an exception.
        ("1e300 ** 2 + 2 ** 40 + 4 ** 0.75", []),
    ],
)
def test_only_exact_identities_are_used(expression: str, operations: list[str]) -> None:
    nodes = Unit("f", f"def f(m):\n    return {{'a': {expression}}}\n").program().needed()
    assert [node.operation for node in nodes if node.operation not in ("constant", "input")] == operations


@pytest.mark.parametrize(("library", "kind"), [("math", "float64"), ("np", "float32")])
def test_one_operation_computes_sine_and_cosine_of_an_angle(library: str, kind: str) -> None:
    angle = "m.a" if kind == "float64" else "m.c"
    values = ", ".join(f"{library}.{name}({angle})" for name in ("sin", "cos", "tan"))
    text = f"import math\nimport numpy as np\n\n\ndef f(m):\n    return {{'v': [{values}]}}\n"
    nodes = [node for node in Unit("f", text).program().needed() if node.operation in ("sincos", "divide")]
    assert [(node.operation, node.kind.name) for node in nodes] == [("sincos", f"{kind}_pair"), ("divide", kind)]


def test_more_units_take_fewer_steps() -> None:
    text = "def f(m):\n    return {'a': (m.a + m.b) * (m.a - m.b) + (m.v[0] + m.v[1]) * (m.v[1] - m.v[2])}\n"
    one, two = (Unit("f", text, limits={"add": count, "multiply": count}).schedule() for count in (1, 2))
    assert [sum(item.steps) for item in (one, two)] == sorted([sum(one.steps), sum(two.steps)], reverse=True)
    assert sum(two.steps) < sum(one.steps)
    assert len(one.units) == 2


def test_operands_are_exchanged_if_the_operator_then_chooses_among_fewer_values() -> None:
    text = "def f(m):\n    return {'a': m.a + m.b, 'b': m.b + m.v[0], 'v': [m.v[0] - m.b, m.a * 2.0, m.b * 0.5]}\n"
    units = Writer(bound(Unit("f", text).schedule())).configuration("f", [], 8)["units"]
    found = {unit["name"]: [[item["value"] for item in one["values"]] for one in unit["operands"]] for unit in units}
    # Differences keep their order: the sign of the second operand is inverted.
    assert found["add_64_0"] == [["in_a", "in_v(63 downto 0)"], ["in_b", "negated(in_b)"]]
    assert found["multiply_64_0"][0] == ["in_a", "in_b"]


def test_an_index_that_nobody_reads_is_no_register() -> None:
    frame = message_frame("float32[] ranges\nfloat64 a\n")
    text = """
def f(m):
    best = 9.0
    for i, r in enumerate(m.ranges):
        best = min(best, VALUE)
    return {"a": best}
"""
    for value, count in (("r", 1), ("r + i", 2)):
        (loop,) = Unit("f", text.replace("VALUE", value)).program(frame).loops
        assert len(loop.carried) == count
