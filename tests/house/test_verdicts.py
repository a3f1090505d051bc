"""Verdicts of `firm test` and `firm build` on benches of each kind, half of which must not pass, nor be stored."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Mapping
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.builds.step.trace import can_trace
from tests.house.test_firm_test import run

pytestmark = pytest.mark.skipif(not can_trace(), reason="strace is not installed or not permitted")

VERILOG = {
    "pass": 'initial begin #5 $warning("slow"); $display("0 errors, PASS"); $finish; end',
    "silent": 'reg a = 1; initial begin #5 if (a !== 1) $fatal(1, "a"); $finish; end',
    "bad_error": 'reg a = 0; initial begin #5 if (a !== 1) $error("a"); $display("PASS"); $finish; end',
    "bad_early": 'initial #9 $finish; initial begin $display("begin"); #10 $display("PASS"); $finish; end',
    "bad_stop": "reg a = 0; initial begin #5 if (a !== 1) $stop; $finish; end",
    "bad_nothing": "reg a = 0; initial #5 a = 1;",
}
VHDL = {
    "pass": "process begin wait for 5 ns; assert a = '1' severity error; report \"PASS\"; wait; end process;",
    "bad_error": "process begin wait for 5 ns; assert a = '0' severity error; report \"PASS\"; wait; end process;",
    "bad_starved": "process begin wait until a = '0'; report \"PASS\"; wait; end process;",
}
PYTEST = {
    "pass": "def test_it():\n    assert 1\n",
    "bad_test": "def test_it():\n    assert 0\n",
    "bad_none": "def it():\n    pass\n",
    "bad_skipped": "import pytest\ndef test_it():\n    pytest.skip()\n",
}
COCOTB = {
    "pass": "@cocotb.test(expect_fail=True)\nasync def it(dut):\n    await check(dut, 0)\n\n"
    "@cocotb.test()\nasync def other(dut):\n    await check(dut, 1)\n",
    "bad_test": "@cocotb.test()\nasync def it(dut):\n    await check(dut, 0)\n",
    "bad_none": "async def it(dut):\n    pass\n",
}
COCOTB_HEAD = """\
import cocotb
from cocotb.triggers import Timer


async def check(dut, value):
    dut.a.value = 1
    await Timer(1, "ns")
    assert dut.b.value == value


"""
# Without it, the steps of Icarus Verilog are seconds.
_WIRE_OF = "`timescale 1ns/1ps\nmodule wire_of(input a, output b); assign b = a; endmodule\n"
WIRE = {
    "ghdl": (
        "wire.vhd",
        "entity wire is port (a : in bit; b : out bit); end; architecture r of wire is begin b <= a; end;",
    ),
    "icarus": ("wire.v", _WIRE_OF),
    "verilator": ("wire.v", _WIRE_OF),
}
VUNIT = {
    "pass": "check(true);",
    "bad_check": "check(false);",
}
KINDS = {".vhd": "vhdlSource-2008", ".sv": "systemVerilogSource", ".v": "verilogSource", ".py": "pythonSource"}


@pytest.fixture
def library(tmp_path: Path) -> Path:
    folder = tmp_path / "library"
    folder.mkdir()
    (folder / "fusesoc.conf").write_text("[main]\nignored_dirs = build\n[library.acme]\nlocation = .\n")
    return folder


def add(library: Path, kind: str, name: str, files: Mapping[str, str], toplevel: str, **target: Any) -> None:
    folder = library / f"{kind}_{name}"
    folder.mkdir()
    listed = []
    for file, text in files.items():
        (folder / file).write_text(text)
        place = {"copyto": file} if file.endswith(".py") else {}
        listed.append({file: {"file_type": KINDS[Path(file).suffix], **place}})
    core = {
        "name": f"acme:{kind}:{name}:1.0",
        "filesets": {"base": {"files": listed}},
        "targets": {"sim": {"filesets": ["base"], "toplevel": toplevel, **target}},
    }
    (folder / f"{name}.core").write_text(f"CAPI=2:\n{yaml.safe_dump(core)}")


def of_flow(tool: str, **options: Any) -> dict[str, Any]:
    return {"flow": "sim", "flow_options": {"tool": tool, **options}}


def results(library: Path, *arguments: str, name: str = "test") -> dict[str, str]:
    events = library / "events"
    _, output = run(library, *arguments, "--events=events", name=name)
    assert events.exists(), output
    ended = [event for line in events.read_text().splitlines() if (event := json.loads(line))["event"] == "end"]
    return {":".join(event["core"].split(":")[1:3]): event["result"] for event in ended}


def check(library: Path, *, runs_again: bool = True) -> None:
    """Run all tests twice: those called 'bad' fail both times, and the others are cached."""
    first = results(library)
    assert first == {name: "failed" if ":bad" in name else "passed" for name in first}
    assert {name.partition(":bad")[1] for name in first} == {"", ":bad"}
    if runs_again:
        assert results(library) == {name: "failed" if ":bad" in name else "cached" for name in first}


def builds_with_verilator() -> bool:
    printed = subprocess.run(["verilator", "--version"], capture_output=True, text=True, check=False).stdout
    found = re.search(r"(\d+)\.(\d+)", printed)
    return found is not None and (version("cocotb") < "2" or (int(found[1]), int(found[2])) >= (5, 36))


def test_plain_benches_and_pytest(library: Path) -> None:
    for name, body in VERILOG.items():
        add(
            library,
            "verilog",
            name,
            {"tb.sv": f"module tb; {body} endmodule"},
            "tb",
            **of_flow("icarus", iverilog_options=["-g2012"]),
        )
    for name, body in VHDL.items():
        text = f"entity tb is end; architecture t of tb is signal a : bit := '1'; begin {body} end;"
        add(library, "vhdl", name, {"tb.vhd": text}, "tb", **of_flow("ghdl"))
    for name, text in PYTEST.items():
        add(library, "pytest", name, {"test_it.py": text}, "none", **of_flow("pytest"))
    check(library)


@pytest.mark.parametrize("options", [(), ("--no-export",)])
def test_firm_build_judges_like_firm_test(library: Path, options: tuple[str, ...]) -> None:
    for name in ("pass", "bad_early"):
        add(
            library,
            "verilog",
            name,
            {"tb.sv": f"module tb; {VERILOG[name]} endmodule"},
            "tb",
            **of_flow("icarus", iverilog_options=["-g2012"]),
        )
    assert results(library, "acme:verilog:*", "--target=sim", *options, name="build") == {
        "verilog:pass": "ok",
        "verilog:bad_early": "failed",
    }
    if options:
        assert results(library, *options) == {"verilog:pass": "passed", "verilog:bad_early": "failed"}


def test_scripts_after_a_run_belong_to_it(library: Path) -> None:
    for name, command in {"good": ["true"], "bad": ["false"]}.items():
        hooked = {**of_flow("icarus", iverilog_options=["-g2012"]), "hooks": {"post_run": ["script"]}}
        add(library, "hook", name, {"tb.sv": f"module tb; {VERILOG['pass']} endmodule"}, "tb", **hooked)
        with (library / f"hook_{name}" / f"{name}.core").open("a") as core:
            core.write(yaml.safe_dump({"scripts": {"script": {"cmd": command}}}))
    assert results(library) == {"hook:good": "passed", "hook:bad": "failed"}


@pytest.mark.check
@pytest.mark.skipif(not find_spec("cocotb"), reason="cocotb is not installed")
@pytest.mark.parametrize("tool", WIRE)
def test_cocotb(library: Path, tool: str) -> None:
    if tool == "verilator" and not builds_with_verilator():
        pytest.skip("cocotb 2 does not build with Verilator before 5.036")
    file, text = WIRE[tool]
    for name, tests in COCOTB.items():
        files = {file: text, "test_it.py": COCOTB_HEAD + tests}
        toplevel = "wire" if tool == "ghdl" else "wire_of"
        add(library, "cocotb", name, files, toplevel, **of_flow(tool, cocotb_module="test_it"))
    check(library)


@pytest.mark.check
@pytest.mark.skipif(not find_spec("vunit"), reason="VUnit is not installed")
def test_vunit(library: Path) -> None:
    for name, body in VUNIT.items():
        text = f"""\
library vunit_lib;
context vunit_lib.vunit_context;
entity tb_it is generic (runner_cfg : string); end;
architecture t of tb_it is
begin
  process begin test_runner_setup(runner, runner_cfg); {body} test_runner_cleanup(runner); end process;
end;
"""
        add(library, "vunit", name, {"tb_it.vhd": text}, "tb_it", default_tool="vunit")
    text = "entity tb_it is end; architecture t of tb_it is begin end;"
    add(library, "vunit", "bad_none", {"tb_it.vhd": text}, "tb_it", default_tool="vunit")
    check(library)
