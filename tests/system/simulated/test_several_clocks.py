"""Systems of three clocks in all simulators: random ones, and one whose environment uses all clocks."""

from __future__ import annotations

import random
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.clocked_systems import clocked_system
from tests.hdl.verilator import simulator
from tests.hdl.verilog import build as build_netlist
from tests.hdl.verilog import compile_verilog, translated
from tests.seeds import seeded
from tests.system.simulated.systems import build, call
from tests.system.simulated.test_resets import SPECIFICATION

SEED = seeded(20261130)
pytestmark = pytest.mark.skipif(
    not all(map(shutil.which, ("iverilog", "verilator"))), reason="Icarus Verilog or Verilator is not installed"
)
# It tells what it sees of each clock by the level of a pin.
ENVIRONMENT = """
library ieee;
use ieee.std_logic_1164.all;
entity surroundings is
  port (clk, rst_n, clk_fast, clk_slow : in std_logic; own_alive, quick_alive, lazy_alive : in std_logic);
end entity;
architecture simulation of surroundings is
  signal own, quick, lazy : std_logic;
begin
  own   <= own_alive when rising_edge(clk);
  quick <= quick_alive when rising_edge(clk_fast);
  lazy  <= lazy_alive when rising_edge(clk_slow);
end architecture;
"""
# For each system.
STARTS = 25
MODEL = "def respond(_, message):\n    return [('pub', message)]\n"


def report(printed: str) -> str:
    """What the host says of all messages and cycles."""
    return printed[printed.index("seed") :].partition("PASS")[0]


@pytest.mark.parametrize(
    "number",
    [pytest.param(0, marks=pytest.mark.check), *(pytest.param(n, marks=pytest.mark.thorough) for n in range(1, 21))],
)
def test_random_systems_pass_in_all_simulators(number: int, tmp_path: Path) -> None:
    """The netlist does the same in every cycle in both of its simulators."""
    print(f"seed {SEED + number}")
    chance = random.Random(SEED + number)
    made = clocked_system(chance, tmp_path, chains=chance.randint(3, 5) if number else 1)
    request = call(made.spec, made.stimuli, made.model)
    assert build(request, tmp_path / "ghdl").passes(SEED=SEED)
    folder = tmp_path / "netlist"
    top, files = translated(request, folder)
    icarus = compile_verilog(top, files, folder).run(folder, SEED=SEED)
    assert icarus.exit_code == 0, icarus.output
    expected = report(icarus.output)
    program = [str(simulator(top, files, folder)), f"+SEED={SEED}"]
    # All registers and memories begin with zeros, with ones, or at random: a reset makes them as new.
    starts = ["0", "1", *(f"2 +verilator+seed+{seed}" for seed in range(1, STARTS - 1))]
    for start in starts:
        options = f"+verilator+rand+reset+{start}".split()
        done = subprocess.run([*program, *options], cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, (start, done.stdout)
        assert report(done.stdout) == expected, start


def test_an_environment_has_all_clocks(tmp_path: Path) -> None:
    paths = spec, stimuli, model, environment = [tmp_path / f"{name}.yaml" for name in ("spec", "stimuli")] + [
        tmp_path / "model.py",
        tmp_path / "surroundings.vhd",
    ]
    texts = SPECIFICATION, "- sub: {x: 1, y: 2, z: 3}\n- sub: {x: -1.5}\n", MODEL, ENVIRONMENT
    for path, text in zip(paths, texts, strict=True):
        path.write_text(text, encoding="utf-8")
    request = call(spec, stimuli, model, environment=[environment.name])
    assert build(request, tmp_path / "ghdl").passes(SEED=SEED)
    done = build_netlist(request, tmp_path / "netlist").run(tmp_path / "netlist", SEED=SEED)
    assert done.exit_code == 0, done.output
