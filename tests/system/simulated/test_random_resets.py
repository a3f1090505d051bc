"""Resets of whole random systems of three clocks, at random cycles, while a clock may stand still.

The simulated host is a copy that resets the system and begins again with the first frame. What comes until the next
reset, and after the last one, must be what a new system sends: the host compares each byte, and the checkers of streams
find levels that are unknown.
"""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest
import yaml

from tests.clocked_systems import clocked_system
from tests.hdl.ghdl import CORES, Library
from tests.seeds import seeded
from tests.system.simulated.systems import GeneratedSystem, build, call
from tests.system.simulated.test_resets import SPECIFICATION
from tests.system.simulated.test_several_clocks import MODEL

SEED = seeded(20261202)
RTL = CORES / "sim" / "rtl"
# The longest time between two resets, in cycles; most of the systems' frames take as long.
GAP = 500
DECLARED = """
    variable resets_left : natural  := {resets};
    variable next_reset  : natural  := 40;
    variable random_3    : positive := SEED;
    variable random_4    : positive := 7;

    procedure restart is
      variable blank : frame_file_t;
      variable draw  : real;
    begin
      uniform(random_3, random_4, draw);
      rst_n         <= '0' after draw * 2.0 * HALF_PERIOD;
      s_axis_tready <= '0' after HOLD;
      offer_nothing;
      uniform(random_3, random_4, draw);
      for reset_cycle in 0 to 1 + integer(9.0 * draw) loop
        clk <= '1';
        clock_cycle;
      end loop;
      rst_n           <= '1' after HOLD;
      resets_left     := resets_left - 1;
      is_offered      := false;
      is_in_frame     := false;
      is_held         := false;
      is_accepting    := false;
      bytes_sent      := 0;
      frames_sent     := 0;
      frames_received := 0;
      frames_right    := 0;
      idle_cycles     := 0;
      expected        := blank;
      read_expected_file(EXPECTED_FILE, expected, ID_BYTES);
      sending         := stimulus.first;
      uniform(random_3, random_4, draw);
      next_reset      := cycle + 1 + integer(real({gap}) * draw);
    end procedure restart;

  begin
    random_1 := SEED;
"""
LOOP = "    while not is_over loop\n"
RESTARTS = """    while resets_left > 0 or not is_over loop
      if resets_left > 0 and cycle >= next_reset then
        restart;
      end if;
"""
# In a clock: one half period in some 300 is longer.
WAIT = "      wait for half;\n"
PAUSES = """      wait for half;
      uniform(random_1, random_2, draw);
      if draw < 0.003 and reference'last_event < LONGEST_GAP then
        wait for 20000.0 * draw * half;
      end if;
"""


def replaced(text: str, old: str, new: str) -> str:
    assert text.count(old) == 1, old
    return text.replace(old, new)


def with_resets(system: GeneratedSystem, resets: int) -> None:
    """Let the host reset the system so often, and the further clocks stand still at times."""
    host = (RTL / "firm_sim_host.vhd").read_text(encoding="ascii")
    host = replaced(host, "\n  begin\n    random_1 := SEED;\n", DECLARED.format(resets=resets, gap=GAP))
    clock = replaced((RTL / "firm_sim_clock.vhd").read_text(encoding="ascii"), WAIT, PAUSES)
    for name, text in (("host", replaced(host, LOOP, RESTARTS)), ("clock", clock)):
        path = system.folder / f"resetting_{name}.vhd"
        path.write_text(text, encoding="ascii")
        Library("firm", system.folder).analyse([path])
    system.work.analyse(system.files)


def resets_pass(number: int, folder: Path, chains: int, resets: int) -> None:
    print(f"seed {SEED + number}")
    made = clocked_system(random.Random(SEED + number), folder, chains)
    system = build(call(made.spec, made.stimuli, made.model), folder / "system")
    with_resets(system, resets)
    assert system.passes(SEED=1 + (SEED + number) % 10**6, STALL_PERCENT=20)


@pytest.mark.check
@pytest.mark.parametrize("number", range(2))
def test_a_system_is_as_new_after_each_reset(number: int, tmp_path: Path) -> None:
    resets_pass(number, tmp_path, chains=1, resets=40)


@pytest.mark.thorough
@pytest.mark.parametrize("number", range(40))
def test_larger_systems_are_as_new_after_each_reset(number: int, tmp_path: Path) -> None:
    resets_pass(number, tmp_path, chains=3, resets=250)


def test_a_design_with_another_reset_and_a_clock_enable(tmp_path: Path) -> None:
    """docs/how-to/adapt-a-design.md"""
    pins = "    pins: [{name: alive, direction: out}]\n"
    text = replaced(SPECIFICATION, pins, "").replace("alive", "adapted")
    sent = [{"sub": {"x": number, "y": -number, "z": 0.5}} for number in range(9)]
    for name, content in (("spec.yaml", text), ("stimuli.yaml", yaml.safe_dump(sent)), ("model.py", MODEL)):
        (tmp_path / name).write_text(content, encoding="utf-8")
    system = build(call(*(tmp_path / name for name in ("spec.yaml", "stimuli.yaml", "model.py"))), tmp_path / "system")
    with_resets(system, 100)
    assert system.passes(SEED=SEED, STALL_PERCENT=30)


def test_a_system_that_is_not_as_new_is_found(tmp_path: Path) -> None:
    """A publisher whose reset is missing goes on with the frame that a reset interrupted."""
    made = clocked_system(random.Random(SEED), tmp_path, 1)
    system = build(call(made.spec, made.stimuli, made.model), tmp_path / "system")
    with_resets(system, 40)
    top = system.folder / f"{system.entity}.vhd"
    text = top.read_text(encoding="utf-8")
    broken = re.sub(r"(u_way0_end0 : entity.*?rst_n +=> )\w+", r"\1'1'", text, count=1, flags=re.DOTALL)
    assert broken != text
    top.write_text(broken, encoding="utf-8")
    system.work.analyse(system.files)
    assert not system.passes(SEED=1, STALL_PERCENT=20)
