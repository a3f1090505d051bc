"""Resets of a generated system: a chain of registers of its own in each clock, in simulation and in the netlist."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

from tests.cores.crossing_paths import Domains, unsynchronised
from tests.hdl.ghdl import Library, core_files
from tests.seeds import seeded
from tests.system.simulated.systems import DATA, HARDWARE, generate_system

SEED = seeded(20261122)
SPECIFICATION = f"""
project:
  name: resets
  clock: 100 MHz
  clocks: [{{name: fast, frequency: 300 MHz}}, {{name: slow, frequency: 24 MHz}}]
accelerators:
  - name: alive
    type: VHDL
    sources: {DATA / "alive.vhd"}
    interface:
      input: [{{middleware: ROS, message: geometry_msgs/Point}}]
      output: [{{middleware: ROS, message: geometry_msgs/Point}}]
    pins: [{{name: alive, direction: out}}]
blocks:
  - {{name: sub, middleware: ROS, mode: subscriber, message: geometry_msgs/Point, outgoing: [{{name: own}}]}}
  - {{name: own, type: alive, outgoing: [{{name: quick}}]}}
  - {{name: quick, type: alive, clock: fast, outgoing: [{{name: lazy}}]}}
  - {{name: lazy, type: alive, clock: slow, outgoing: [{{name: pub}}]}}
  - {{name: pub, middleware: ROS, mode: publisher, message: geometry_msgs/Point}}
"""
RESETS = Path(__file__).with_name("resets_bench.vhd")
CLOCKS = {"clk": "clk", "clk_fast": "fast", "clk_slow": "slow"}
PINS = {"own_alive": "clk", "quick_alive": "fast", "lazy_alive": "slow"}


@pytest.fixture
def system(tmp_path: Path) -> Library:
    """The system with the synchronisers of the hardware."""
    spec = tmp_path / "spec.yaml"
    spec.write_text(SPECIFICATION, encoding="utf-8")
    files = generate_system(spec, tmp_path)
    Library("firm", tmp_path).analyse(core_files(*HARDWARE))
    work = Library("work", tmp_path)
    work.analyse([*files, RESETS])
    return work


def faults(system: Library, folder: Path) -> list[str]:
    """What the netlist's registers get from other clocks, or from the reset, which has none, without a synchroniser."""
    domains = Domains(CLOCKS, lambda port: "none" if port == "rst_n" else PINS.get(port, "clk"))
    return unsynchronised(system.synthesise("resets_system", language="verilog"), "resets_system", folder, domains)


def test_each_clock_has_a_reset_of_its_own(system: Library, tmp_path: Path) -> None:
    source = random.Random(SEED)
    for _ in range(3):
        periods = {"OWN_PS": 10000, "FAST_PS": source.randrange(2000, 9000), "SLOW_PS": source.randrange(11000, 60000)}
        generics = {"SEED": source.randrange(1, 10**6), **periods}
        print(generics)
        done = system.run("resets_bench", generics)
        assert done.exit_code == 0 and "PASS 100" in done.output, done.output
    assert faults(system, tmp_path) == []


@pytest.mark.parametrize("part", ["u_lazy", "u_manager", "u_own"])
def test_a_domain_that_takes_another_reset_is_found(system: Library, tmp_path: Path, part: str) -> None:
    top = tmp_path / "resets_system.vhd"
    text = top.read_text(encoding="utf-8")
    broken = re.sub(rf"({part} : entity.*?rst_n +=> )\w+", r"\1rst_n", text, count=1, flags=re.DOTALL)
    assert broken != text
    top.write_text(broken, encoding="utf-8")
    system.analyse([top, RESETS])
    if part == "u_manager":
        assert any(fault.startswith("rst_n into ") for fault in faults(system, tmp_path))
    else:
        done = system.run("resets_bench", {"SEED": SEED})
        assert "left its reset" in done.output and done.exit_code != 0
