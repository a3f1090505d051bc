"""The status of a derived system: its identity, its registers, and the files of `firm registers`."""

from __future__ import annotations

import ast
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from systemrdl.node import FieldNode

from fusesoc_firm.cli import main
from fusesoc_firm.system.derived.model import StatusAccess
from fusesoc_firm.system.derived.status import status_of
from fusesoc_firm.system.hardware.registers import compiled, register_map
from fusesoc_firm.system.hardware.status import identity_of, status_map
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.system.system_core import identity, status_text
from fusesoc_firm.text.diagnostics import Diagnostics
from fusesoc_firm.text.yaml_text import Text
from tests.hdl.ghdl import REPOSITORY

SPEC = REPOSITORY / "specs" / "quat2euler" / "quat2euler.yaml"


def test_the_digest_is_of_what_the_host_must_know() -> None:
    loaded = load_beside(SPEC, [], None)
    system, found = loaded.system, identity(loaded)
    # The MD5 sums of geometry_msgs/Quaternion and Point.
    assert found.signatures == ("a779879f", "4a842b65")
    whole = ("a779879fadf0160734f906b8c19c7004", "4a842b65f413084dc2b10fb484ea7f17")
    assert identity_of(system, whole) == found
    assert identity_of(replace(system, width=512, fpga_part="other"), whole) == found
    other = replace(system.subscribers[0], given_name="other")
    for changed in (replace(system, name="other"), replace(system, subscribers=(other,))):
        assert identity_of(changed, whole).digest != found.digest
    assert identity_of(system, whole[::-1]).digest != found.digest


@pytest.mark.parametrize(("subscribers", "publishers"), [(1, 1), (3, 5), (255, 255), (256, 256)])
def test_registers_do_not_overlap(subscribers: int, publishers: int) -> None:
    registers = status_map("robot", subscribers, publishers).registers
    addresses = [register.address for register in registers]
    assert len({*addresses}) == len(addresses)
    assert max(addresses) < 2**16
    shape = registers[1].fields
    assert [field.reset for field in shape] == [subscribers, publishers, 1]


@pytest.mark.parametrize(("converters", "faults"), [(255, 0), (256, 1)])
def test_no_converter_has_the_id_of_the_status(converters: int, faults: int) -> None:
    found = Diagnostics()
    project = replace(load_beside(SPEC, [], None).specification.project, status=Text("frames"))
    assert status_of(project, None, converters, 1, found) is StatusAccess.FRAMES
    assert len(found.found) == faults


@pytest.mark.parametrize(("converters", "faults"), [(2048, 0), (2049, 1)])
def test_the_registers_of_two_byte_ids_have_a_limit(converters: int, faults: int) -> None:
    found = Diagnostics()
    project = replace(load_beside(SPEC, [], None).specification.project, status=Text("frames"), id_bytes=2)
    assert status_of(project, None, 2048, converters, found) is StatusAccess.FRAMES
    assert len(found.found) == faults


def test_the_files_of_the_registers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("peakrdl_python")
    assert main(["registers", str(SPEC), "-o", str(tmp_path)]) == 1
    assert "has no status" in capsys.readouterr().err
    spec = tmp_path / "spec.yaml"
    spec.write_text(SPEC.read_text().replace("  name: quat2euler\n", "  name: quat2euler\n  status: frames\n", 1))
    assert main(["registers", str(spec), "-o", str(tmp_path / "made")]) == 0
    text = (tmp_path / "made" / "quat2euler_status.rdl").read_text()
    assert text == status_text(load_beside(spec, [], None, needs_sources=False))
    assert register_map(text).by_name["publisher[0].longest_wait"].address == 0x8078
    writes = {
        node.get_path(): onwrite.name
        for node in compiled(tmp_path / "made" / "quat2euler_status.rdl").descendants()
        if isinstance(node, FieldNode) and (onwrite := node.get_property("onwrite"))
    }
    cleared = ("frame_error", "id_error", "link_error", "lost")
    assert writes == {f"quat2euler_status.interrupt.{name}": "woclr" for name in cleared}
    program = '#include "quat2euler_status.h"\n#include <stddef.h>\n'
    program += '_Static_assert(offsetof(quat2euler_status_t, publisher[0].longest_wait) == 0x8078, "place");\n'
    (tmp_path / "made" / "use.c").write_text(program)
    command = ["gcc", "-std=c11", "-Wall", "-Werror", "-c", "use.c", "-o", "use.o"]
    subprocess.run(command, cwd=tmp_path / "made", check=True)
    for path in (tmp_path / "made" / "quat2euler_status" / "reg_model").glob("*.py"):
        ast.parse(path.read_text())
    assert (tmp_path / "made" / "quat2euler_status_page" / "index.html").is_file()
