"""A system with pins in simulation: what its environment gives comes back in messages, or lows without one."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cores.crossing_paths import Domains, unsynchronised
from tests.hdl.ghdl import Library, core_files
from tests.system.simulated.systems import DATA, HARDWARE, build, call, generate_system

SPECIFICATION = f"""
project: {{name: probes}}
accelerators:
  - name: probe
    type: VHDL
    sources: {DATA / "probe.vhd"}
    interface:
      input: [{{middleware: ROS, message: geometry_msgs/Point}}]
      output: [{{middleware: ROS, message: geometry_msgs/Point}}]
    pins:
      - {{name: asked, direction: out}}
      - {{name: level, direction: in, bits: 64, synchroniser: none}}
blocks:
  - {{name: one, middleware: ROS, mode: subscriber, message: geometry_msgs/Point, outgoing: [{{name: first}}]}}
  - {{name: two, middleware: ROS, mode: subscriber, message: geometry_msgs/Point, outgoing: [{{name: second}}]}}
  - {{name: first, type: probe, outgoing: [{{name: from_one}}]}}
  - {{name: second, type: probe, outgoing: [{{name: from_two}}]}}
  - {{name: from_one, middleware: ROS, mode: publisher, message: geometry_msgs/Point}}
  - {{name: from_two, middleware: ROS, mode: publisher, message: geometry_msgs/Point}}
"""


@pytest.mark.parametrize(("environment", "levels"), [([str(DATA / "levels.vhd")], (1.5, -2.0)), (None, (0.0, 0.0))])
def test_pins_lead_to_the_environment(
    tmp_path: Path, environment: list[str] | None, levels: tuple[float, float]
) -> None:
    (tmp_path / "spec.yaml").write_text(SPECIFICATION)
    (tmp_path / "stimuli.yaml").write_text(
        "".join(f"- {name}: {{x: 7.0, y: 2.0, z: 3.0}}\n" for name in ["one", "two"] * 4)
    )
    (tmp_path / "model.py").write_text(
        f"LEVELS = {dict(zip(('one', 'two'), levels, strict=True))}\n"
        "def respond(subscriber, message):\n"
        "    return [('from_' + subscriber, {**message, 'x': LEVELS[subscriber]})]\n"
    )
    request = call(tmp_path / "spec.yaml", tmp_path / "stimuli.yaml", tmp_path / "model.py", environment=environment)
    system = build(request, tmp_path / "system")
    assert system.passes(STALL_PERCENT=0)
    assert system.passes(SEED=5, STALL_PERCENT=60)
    system.replace_by_netlist()
    assert system.passes(SEED=6)


LAMPS = f"""
project: {{name: lamps, clock: 100 MHz, clocks: [{{name: fast, frequency: 300 MHz}}]}}
accelerators:
  - name: lamp
    type: VHDL
    sources: {DATA / "lamp.vhd"}
    interface:
      input: [{{middleware: ROS, message: geometry_msgs/Point}}]
      output: [{{middleware: ROS, message: geometry_msgs/Point}}]
    pins: [{{name: button, direction: in}}, {{name: lamp, direction: out}}]
blocks:
  - {{name: sub, middleware: ROS, mode: subscriber, message: geometry_msgs/Point, outgoing: [{{name: own}}]}}
  - {{name: own, type: lamp, outgoing: [{{name: quick}}]}}
  - {{name: quick, type: lamp, clock: fast, outgoing: [{{name: pub}}]}}
  - {{name: pub, middleware: ROS, mode: publisher, message: geometry_msgs/Point}}
"""
SIDES = {"own_button": "outside", "quick_button": "outside", "quick_lamp": "fast"}


@pytest.mark.parametrize(
    ("written", "found"),
    [
        ("direction: in", []),
        ("direction: in, synchroniser: none", ["own_button into own_lamp", "quick_button into quick_lamp"]),
    ],
)
def test_an_input_is_synchronised_to_its_own_clock(tmp_path: Path, written: str, found: list[str]) -> None:
    (tmp_path / "spec.yaml").write_text(LAMPS.replace("direction: in", written), encoding="utf-8")
    files = generate_system(tmp_path / "spec.yaml", tmp_path)
    Library("firm", tmp_path).analyse(core_files(*HARDWARE))
    work = Library("work", tmp_path)
    work.analyse(files)
    domains = Domains({"clk": "clk", "clk_fast": "fast"}, lambda port: SIDES.get(port, "clk"))
    verilog = work.synthesise("lamps_system", language="verilog")
    assert unsynchronised(verilog, "lamps_system", tmp_path, domains) == found
