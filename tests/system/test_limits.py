"""Limits of compiled functions in cycles: what meets them, what is refused, and the cycles of the hardware itself."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from random import Random

import chevron
import pytest

from fusesoc_firm.compiler.interface import side_of
from fusesoc_firm.compiler.program import Program, Task, compile_function
from fusesoc_firm.compiler.schedule import scheduled
from fusesoc_firm.compiler.source import Source
from fusesoc_firm.system.hardware.compiled import schedule_of
from fusesoc_firm.system.hardware.estimate import estimate
from fusesoc_firm.system.hardware.limits import (
    BudgetError,
    LimitError,
    Limits,
    counts_to_try,
    fastest_of_budget,
    fastest_within,
    operations_of,
    used,
)
from fusesoc_firm.text.diagnostics import InputError
from tests.compiler.compiled import Unit, bits_of_message, message_frame, placed_bits, random_messages
from tests.hdl.ghdl import Library, core_files
from tests.seeds import seeded
from tests.system.systems import accelerator, converter, derived, instance, messages, specification

SEED = seeded(20260811)
FOLDER = Path(__file__).parents[1] / "compiler"
PRODUCTS = """
def f(m):
    return {"a": (m.a * m.b + m.v[0] * m.v[1]) + (m.a * m.v[2] + m.b * m.v[0])}
"""
BLOCKS = (
    converter("in", "subscriber", "Vector3", "work")
    + instance("work", "f", "out")
    + converter("out", "publisher", "Vector3")
)
COMPILED = accelerator("f", "Vector3", "Vector3", "Python", "f.py")
SUMS = "def f(m):\n    return {'x': ((m.x + m.y) * (m.y + m.z)) * ((m.z + m.x) * (m.x - m.y)) * (m.y - m.z)}\n"


def cycles(folder: Path, keys: str) -> tuple[int, int, dict[str, int]]:
    """The latency, the interval and the operators of the function in `SUMS` with further keys of its accelerator."""
    (folder / "f.py").write_text(SUMS, encoding="utf-8")
    text = specification(BLOCKS, COMPILED.replace("type: Python", f"type: Python, {keys}"))
    system = derived(folder, text)
    schedule = schedule_of(system.accelerator_types[0].own, folder)
    return schedule.latency, schedule.interval, used(schedule)


def test_without_a_limit_there_is_one_operator_of_a_kind(tmp_path: Path) -> None:
    latency, interval, operators = cycles(tmp_path, "numbers: float64")
    assert operators == {"add": 1, "multiply": 1}
    assert cycles(tmp_path, f"latency: {latency}, interval: {interval}")[:2] == (latency, interval)


def test_a_limit_takes_as_few_more_operators_as_needed(tmp_path: Path) -> None:
    program = Unit("f", PRODUCTS).program()
    slow, fast = fastest_within(program, {}, Limits()), fastest_within(program, {"add": 16, "multiply": 16}, Limits())
    for limit in range(fast.latency, slow.latency + 1):
        found = fastest_within(program, {}, Limits(limit))
        assert found.latency <= limit
        counts = used(found)
        for name in counts:
            fewer = counts | {name: counts[name] - 1}
            assert not fewer[name] or fastest_within(program, fewer, Limits()).latency > limit, (limit, counts)
    with pytest.raises(LimitError) as raised:
        fastest_within(program, {}, Limits(fast.latency - 1))
    assert (raised.value.name, raised.value.cycles) == ("latency", fast.latency)


def test_resources_that_are_given_stay(tmp_path: Path) -> None:
    latency, _, operators = cycles(tmp_path, "resources: {multiply: 1}")
    assert operators == {"add": 1, "multiply": 1}
    assert cycles(tmp_path, f"resources: {{multiply: 1}}, latency: {latency - 1}")[2] == {"add": 2, "multiply": 1}


@pytest.mark.parametrize(("key", "more"), [("latency", 0), ("interval", 2)])
def test_a_limit_that_cannot_be_met_is_refused_with_the_number_that_can_be_met(
    key: str, more: int, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as raised:
        cycles(tmp_path, f"resources: {{multiply: 1}}, {key}: 3")
    (fault,) = raised.value.diagnostics
    assert fault.message == f"'{key}' of 'f' cannot be 3 with 'resources: {{multiply: 1}}'"
    assert fault.source
    assert fault.source.text[fault.source.column - 1] == "3"
    shortest = int(re.findall(r"\d+", fault.hint)[0])
    found = cycles(tmp_path, f"resources: {{multiply: 1}}, {key}: {shortest}")
    assert found[0] + more == shortest
    with pytest.raises(InputError):
        cycles(tmp_path, f"resources: {{multiply: 1}}, {key}: {shortest - 1}")


LOOPS = """
class Scan:
    def __init__(self):
        self.best = 0.0

    def __call__(self, m):
        best, near, before = 1e9, 0, m.low
        for i, r in enumerate(m.ranges):
            moved = r * 2.0 - before * m.low
            before = r
            if moved < best:
                best = moved
            if moved * 0.5 < 1.0:
                near += i
        self.best = best
        return {"x": best, "i": near}


scan = Scan()
"""
SCAN = message_frame("float32 low\nfloat32[] ranges\nfloat32 x\nint32 i\n")


def scan_program(text: str) -> Program:
    return compile_function(Task(Source("scan.py", text), "scan", [side_of("in_", SCAN)], [side_of("out_", SCAN)]))


def test_a_loop_whose_operations_have_operators_of_their_own_is_a_pipeline() -> None:
    program = scan_program(LOOPS)
    one = scheduled(program)
    assert (one.depths, one.element > 20) == ({}, True)
    found = fastest_within(program, {}, Limits(element=1))
    assert found.element == 1
    assert used(found) == {"multiply": 3, "add": 1}
    assert fastest_within(program, {}, Limits(element=one.element)).depths == {}
    with pytest.raises(LimitError) as raised:
        fastest_within(program, {"multiply": 2}, Limits(element=1))
    assert (raised.value.name, raised.value.cycles > 1) == ("element", True)


@pytest.mark.parametrize(
    ("statement", "cycles"), [("best = best + r", 9), ("best = r / m.low", 20), ("best = max(best, r * best)", 10)]
)
def test_a_loop_that_waits_for_its_own_results_is_none(statement: str, cycles: int) -> None:
    text = f"def scan(m):\n    best = m.low\n    for r in m.ranges:\n        {statement}\n    return {{'x': best}}\n"
    with pytest.raises(LimitError) as raised:
        fastest_within(scan_program(text), {}, Limits(element=1))
    assert raised.value.cycles >= cycles


def test_a_budget_selects_the_fastest_operators_within_it(tmp_path: Path) -> None:
    program = Unit("f", PRODUCTS).program()
    found = [scheduled(program, counts) for counts in counts_to_try(program, {})]
    sizes = {estimate(item).lut for item in found}
    latencies = set()
    for most in sorted(sizes):
        best = fastest_of_budget(program, {}, {"lut": most})
        assert estimate(best).lut <= most
        assert best.latency == min(item.latency for item in found if estimate(item).lut <= most)
        latencies.add(best.latency)
    assert len(latencies) > 1
    least = min(sizes)
    with pytest.raises(BudgetError) as raised:
        fastest_of_budget(program, {}, {"lut": least - 1})
    assert raised.value.least["lut"] == least
    assert used(fastest_of_budget(program, {}, {"dsp": 18})) | {"add": 0} == {"add": 0, "multiply": 2}


def test_a_budget_is_kept_beside_given_operators_and_limits(tmp_path: Path) -> None:
    assert cycles(tmp_path, "resources: {dsp: 18}")[2]["multiply"] == 2
    latency, _, operators = cycles(tmp_path, "resources: {dsp: 27, multiply: 1}")
    assert operators["multiply"] == 1
    assert cycles(tmp_path, f"resources: {{dsp: 27, multiply: 1}}, latency: {latency}")[0] == latency
    keys = f"resources: {{multiply: 1, dsp: 27}}, latency: {latency - 1}"
    with pytest.raises(InputError, match=f"legal here: {latency} cycles or more"):
        cycles(tmp_path, keys)
    with pytest.raises(InputError) as raised:
        cycles(tmp_path, "resources: {lut: 9000, dsp: 8}")
    (fault,) = raised.value.diagnostics
    assert (fault.message, fault.hint) == ("'f' is larger than the 8 of 'dsp'", "legal here: at least 9, as estimated")
    assert fault.source
    assert fault.source.text[fault.source.column - 1] == "8"


def test_the_limit_of_elements_is_legal_only_for_python(tmp_path: Path) -> None:
    types = accelerator("f", "Vector3", "Vector3").replace("VHDL", "VHDL, latency: 3, interval: 4, element: 1")
    with pytest.raises(InputError) as raised:
        derived(tmp_path, specification(BLOCKS, types))
    assert messages(raised.value) == ["'element' is legal only for Python, but 'f' has the type VHDL"]


def test_costly_operators_are_spared_first() -> None:
    program = Unit("f", PRODUCTS).program()
    assert [*operations_of(program)] == ["multiply", "add"]
    assert operations_of(program)["multiply"].cost.dsp == 9


def test_an_operator_that_is_not_measured_has_cells_and_no_clock() -> None:
    schedule = Unit("f", "def f(m):\n    return {'i': m.i // m.j, 'a': m.a + m.b}\n").schedule()
    clocks = [unit.operator.cost.megahertz for unit in schedule.units]
    found = estimate(schedule)
    assert found.megahertz >= min(filter(None, clocks)) * 0.5
    adder = next(unit.operator.cost for unit in schedule.units if unit.operator.operation == "add")
    assert found.lut > adder.lut + 32


@pytest.mark.check
@pytest.mark.parametrize("limits", [{}, {"add": 2, "multiply": 3}])
def test_the_hardware_takes_these_cycles(limits: Mapping[str, int], tmp_path: Path) -> None:
    for text in (PRODUCTS, PRODUCTS.replace("m.a * m.b", "m.a / m.b"), "def f(m):\n    return {'a': m.a}\n"):
        unit = Unit("f", text, limits=limits)
        assert simulated_cycles(unit, tmp_path) == {(unit.schedule().latency, unit.schedule().interval)}


def simulated_cycles(unit: Unit, folder: Path) -> set[tuple[int, int]]:
    firm, work = Library("firm", folder), Library("work", folder)
    firm.analyse(core_files("axis/package", "acc/cordic/cordic", "acc/float/float", "acc/python/python"))
    (inputs, in_bits), (outputs, out_bits) = placed_bits("in_"), placed_bits("out_")
    message = {**random_messages(Random(SEED), 1)[0], "a": 1.5, "b": 2.5, "v": [0.5, 3.0, 4.0]}
    bench = chevron.render(
        (FOLDER / "cycles_bench.vhd.mustache").read_text(encoding="utf-8"),
        {
            "name": unit.name,
            "message": bits_of_message(message),
            "in_bits": in_bits,
            "out_bits": out_bits,
            "inputs": inputs,
            "outputs": outputs,
        },
    )
    (folder / "f.vhd").write_text(unit.vhdl(), encoding="utf-8")
    (folder / "cycles_bench.vhd").write_text(bench, encoding="utf-8")
    work.analyse([folder / "f.vhd", folder / "cycles_bench.vhd"])
    found = work.run("cycles_bench", {}, seconds=60)
    return {(int(a), int(b)) for a, b in re.findall(r"latency (\d+) interval (\d+)", found.output)}
