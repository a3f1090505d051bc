"""The check between layout and bitstream: nextpnr must have judged by the board's clocks."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.builds.step.clock_check import faults, main
from fusesoc_firm.builds.step.flow import backend, resolved
from fusesoc_firm.tools.flows import NETLIST, Flow
from fusesoc_firm.tools.open_flows import OPEN_FLOWS


def report(**clocks: tuple[float, float]) -> dict[str, Any]:
    return {"fmax": {name: {"achieved": reached, "constraint": judged} for name, (reached, judged) in clocks.items()}}


# Nets as nextpnr names them for each family.
NETS = {
    "apicula": "u_system.clk",
    "gatemate": "u_system.clk",
    "icestorm": "clk$SB_IO_IN_$glb_clk",
    "machxo2": "clk$TRELLIS_IO_IN$glb_clk",
    "nexus": "u_system.clk$glb_clk",
    "trellis": "$glbnet$clk",
}


@pytest.mark.parametrize("flow", OPEN_FLOWS)
def test_the_clock_of_each_family_is_recognised(flow: str) -> None:
    net = NETS[flow]
    # nextpnr counts periods in picoseconds.
    assert faults(report(**{net: (64.2, 12.00004768)}), {"clk": 12.0}) == []
    (lost,) = faults(report(**{net: (64.2, 12.0)}), {"clk": 25.0})
    assert lost == "clock 'clk' was judged by 12 MHz; the board's has 25 MHz"
    (slow,) = faults(report(**{net: (24.21, 25.0)}), {"clk": 25.0})
    assert slow == f"clock '{net}' reaches 24.21 MHz, not 25 MHz"


def test_each_clock_must_be_there_and_known() -> None:
    clocks = {"clk": 125.0, "rgmii_rx_clk": 125.0}
    nets = {"$glbnet$clk": (130.0, 125.0), "$glbnet$rgmii_rx_clk$TRELLIS_IO_IN": (140.0, 125.0)}
    assert faults(report(**nets), clocks) == []
    (missing,) = faults(report(**dict([*nets.items()][:1])), clocks)
    assert missing == "the report has no clock 'rgmii_rx_clk' of 125 MHz"
    (unknown,) = faults(report(**nets, gated=(400.0, 12.0)), clocks)
    assert unknown == "clock 'gated' is none of the board's: clk, rgmii_rx_clk"


def test_a_fault_ends_the_build(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["report.json", "clk=12"]) == 1
    assert capsys.readouterr().out == (
        "ERROR: there is no report.json; nextpnr writes it with the option --report report.json\n"
    )
    Path("report.json").write_text(json.dumps(report(clk=(50.0, 12.0))))
    assert main(["report.json", "clk=12"]) == 0
    assert main(["report.json", "clk=16.5"]) == 1
    assert capsys.readouterr().out == "ERROR: clock 'clk' was judged by 12 MHz; the board's has 16.5 MHz\n"


@pytest.mark.parametrize("name", OPEN_FLOWS)
def test_each_open_flow_checks_before_it_packs(tmp_path: Path, name: str) -> None:
    options = {"frontends": [NETLIST], "nextpnr_options": ["--seed", "1"], "device": "GW1NR-LV9QN88PC6/I5"}
    if not OPEN_FLOWS[name].needs_device:
        del options["device"]
    flow = Flow(name, options, clocks={"clk": "27", "rx_clk": "125"})
    (tmp_path / flow.file_name()).write_text(flow.text())
    kind = OPEN_FLOWS[name].file_type
    files = [("a.vhd", "vhdlSource-93"), ("pins", kind), (flow.file_name(), "user")]
    edam = {
        "name": "robot",
        "toplevel": "top",
        "files": [{"name": file, "file_type": type_} for file, type_ in files],
        "flow_options": {},
    }
    backend(*resolved("flow", "firm", edam, str(tmp_path)), str(tmp_path)).configure()
    rules = (tmp_path / "Makefile").read_text().split("\n\n")
    (packing,) = (rule for rule in rules if rule.startswith(f"robot{OPEN_FLOWS[name].bitstream}:"))
    check, packer = packing.splitlines()[1:]
    assert check.endswith(" -m fusesoc_firm.builds.step.clock_check report.json clk=27 rx_clk=125")
    assert OPEN_FLOWS[name].packing in packer
    (layout,) = (rule for rule in rules if f" {OPEN_FLOWS[name].layout} " in rule and "--gui" not in rule)
    assert "--seed 1" in layout
    assert "pins" in layout or kind == "CST"
