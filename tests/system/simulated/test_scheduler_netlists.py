"""Every scheduler has a netlist in Verilog: GHDL finds no signal without a value in it."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.scheduling.policies import POLICIES
from tests.hdl.ghdl import core_files
from tests.hdl.verilog import netlist
from tests.system.simulated.systems import HARDWARE, generate_system
from tools.bench.loops import found_by_us

MESSAGE = "middleware: ROS1, message: std_msgs/UInt8"
# With 17 requesters, least recently used has no matrix any more, and no policy compares all requesters in one cycle.
FEW, MANY = 3, 17


@pytest.mark.parametrize("publishers", [FEW, pytest.param(MANY, marks=pytest.mark.check)])
@pytest.mark.parametrize("policy", POLICIES)
def test_a_system_with_each_scheduler_has_a_netlist(tmp_path: Path, policy: str, publishers: int) -> None:
    """No loop is in it either."""
    lines = [f"project: {{name: scheduled, width: 8, scheduler: {policy}}}", "blocks:"]
    for number in range(publishers):
        lines += [
            f"  - {{name: s{number}, mode: subscriber, {MESSAGE}, outgoing: [{{name: p{number}}}]}}",
            f"  - {{name: p{number}, mode: publisher, {MESSAGE}, period: 1000}}",
        ]
    specification = tmp_path / "scheduled.yaml"
    specification.write_text("\n".join(lines) + "\n", encoding="ascii")
    work = generate_system(specification, tmp_path / "system")
    assert netlist(work[-1].stem, tmp_path, work, core_files(*HARDWARE)).is_file()
    assert not found_by_us(work, tmp_path)
