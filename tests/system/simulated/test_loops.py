"""A system whose accelerator closes a combinational loop: `lint` names the accelerator's ports."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from tests.hdl.ghdl import core_files
from tests.hdl.verilog import loops
from tests.system.simulated.systems import DATA, HARDWARE, generate_system
from tests.system.simulated.test_variable_system import IMAGE, converter, image_accelerator

FORWARDED = "out_msg_valid                   <= in_msg_valid;"


@pytest.mark.parametrize("waits", [True, False])
def test_a_valid_that_waits_for_its_ready_is_named(tmp_path: Path, waits: bool) -> None:
    source = (DATA / "invert.vhd").read_text(encoding="ascii")
    assert FORWARDED in source
    waiting = FORWARDED.replace(";", " and out_msg_ready;")
    (tmp_path / "invert.vhd").write_text(source.replace(FORWARDED, waiting) if waits else source, encoding="ascii")
    blocks = [
        converter("sub", "subscriber", IMAGE, "acc"),
        {"name": "acc", "type": "invert", "outgoing": [{"name": "pub"}]},
        converter("pub", "publisher", IMAGE),
    ]
    content = {
        "project": {"name": "loopy"},
        "accelerators": [image_accelerator(length="given")],
        "blocks": blocks,
    }
    (tmp_path / "system.yaml").write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    work = generate_system(tmp_path / "system.yaml", tmp_path / "work")
    said = loops(work[-1].stem, tmp_path, work, core_files(*HARDWARE))
    assert len(said) == waits, said
    if said:
        assert "'out_msg_valid' of 'u_acc' depends on its 'out_msg_ready', which depends on it" in said[0]
        assert "'u_pub' (from 'msg_valid' to 'msg_ready')" in said[0]
