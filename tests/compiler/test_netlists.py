"""Compiled functions as netlists answer as Python does: in Icarus and Verilator, and mapped to cells of an ECP5."""

from __future__ import annotations

import random
import shutil
import subprocess
from pathlib import Path

import chevron
import pytest

from tests.compiler.compiled import (
    CORES,
    Unit,
    answers_of,
    bits_of_message,
    differences,
    placed_bits,
    random_messages,
)
from tests.compiler.random_functions import RandomFunction
from tests.hdl.ghdl import core_files
from tests.hdl.verilator import simulator
from tests.hdl.verilog import compile_verilog, netlist
from tests.seeds import seeded

SEED = seeded(20261201)
_TEMPLATE = Path(__file__).with_name("compiled_bench.v.mustache")
_FIXED = """
class Fixed:
    def __init__(self):
        self.s = 0.0

    def __call__(self, m):
        self.s += 0.25 * m.a
        return {"a": self.s, "b": m.a * m.b - m.c / 3.0, "d": max(m.c, m.d), "n": round(m.b) * 3 + int(m.a)}


fixed = Fixed()
"""
_MAPPED = """
def mapped(m):
    best = m.a
    for x in m.v:
        best = x if x < best else best
    return {"a": best, "i": m.i * 3 + m.j // 4, "k": m.w[m.k & 3], "c": m.c if m.p else -m.d, "q": m.c <= m.d}
"""


def bench(unit: Unit, folder: Path, count: int) -> Path:
    """The bench in Verilog, which writes the answers beside it."""
    (inputs, in_bits), (outputs, out_bits) = placed_bits("in_"), placed_bits("out_")
    text = chevron.render(
        _TEMPLATE.read_text(encoding="utf-8"),
        {"name": unit.name, "in_high": in_bits - 1, "out_high": out_bits - 1, "last": count - 1, "seed": SEED,
         "inputs": inputs, "outputs": outputs},
    )  # fmt: skip
    path = folder / "compiled_bench.v"
    path.write_text(text, encoding="utf-8")
    return path


def check(unit: Unit, simulators: list[str], messages: int, folder: Path) -> None:
    """Compare the answers of a netlist, or of one of cells, with those of the function."""
    print("seed", SEED)
    sent = random_messages(random.Random(SEED), messages)
    wanted = unit.expected(sent, folder)
    (folder / f"{unit.name}.vhd").write_text(unit.vhdl(), encoding="utf-8")
    made = netlist(unit.name, folder, [folder / f"{unit.name}.vhd"], core_files("acc/cordic/cordic", *CORES))
    for name in simulators:
        own = folder / name
        own.mkdir()
        (own / "vectors.txt").write_text("".join(f"{bits_of_message(message)}\n" for message in sent), encoding="ascii")
        files = [bench(unit, own, len(sent)), *(_mapped(made, unit.name, own) if name == "cells" else [made])]
        if name == "verilator":
            done = subprocess.run(
                [simulator("compiled_bench", files, own)], cwd=own, capture_output=True, text=True, check=True
            )
            output = done.stdout
        else:
            output = compile_verilog("compiled_bench", files, own).run(own).output
        assert "DONE" in output, output
        found = answers_of(own / f"{unit.name}.txt")
        wrong = differences(unit, sent, wanted, found)
        assert not wrong, f"{name}: {wrong[0]}"


# Yosys has no model of the multipliers of an ECP5.
def _mapped(made: Path, name: str, folder: Path) -> list[Path]:
    script = f"read_verilog {made}; synth_ecp5 -nodsp -top {name}; write_verilog -noattr {folder / 'mapped.v'}"
    subprocess.run(["yosys", "-q", "-p", script], check=True, capture_output=True)
    cells = Path(shutil.which("yosys") or "").parents[1] / "share" / "yosys" / "ecp5" / "cells_sim.v"
    return [folder / "mapped.v", cells]


@pytest.mark.check
@pytest.mark.skipif(not all(map(shutil.which, ("iverilog", "verilator"))), reason="no iverilog or verilator")
@pytest.mark.parametrize("numbers", ["fixed(18, 9)", pytest.param("fixed(40, 20)", marks=pytest.mark.thorough)])
def test_a_netlist_has_the_same_answers_in_other_simulators(numbers: str, tmp_path: Path) -> None:
    check(Unit("fixed", _FIXED, numbers), ["icarus", "verilator"], 30, tmp_path)


@pytest.mark.check
@pytest.mark.skipif(not all(map(shutil.which, ("iverilog", "yosys"))), reason="no iverilog or yosys")
def test_a_function_of_cells_has_the_same_answers(tmp_path: Path) -> None:
    check(Unit("mapped", _MAPPED), ["cells"], 30, tmp_path)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(1, 21))
def test_netlists_of_random_functions_have_the_same_answers(seed: int, tmp_path: Path) -> None:
    text = RandomFunction(random.Random(seed), "random").text()
    check(Unit("random", text, limits={"add": 1 + seed % 2}), ["icarus", "verilator"], 30, tmp_path)
