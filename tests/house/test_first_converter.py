"""docs/tutorials/first-converter.md, followed to the letter in a workspace like the one it describes."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.hdl.ghdl import REPOSITORY

PAGE = REPOSITORY / "docs" / "tutorials" / "first-converter.md"
needs_tools = pytest.mark.skipif(
    not all(map(shutil.which, ("ghdl", "verilator"))), reason="GHDL or Verilator is not installed"
)

# A library with the structure of SERV, without its content.
LIBRARY = {
    "serv.core": """\
CAPI=2:
name: award-winning:serv:serv:1.4.0
filesets:
  core: {files: [rtl/serv_top.v], file_type: verilogSource}
targets:
  default: {filesets: [core], toplevel: serv_top}
  lint: {filesets: [core], flow: lint, flow_options: {tool: verilator}, toplevel: serv_top}
""",
    "rtl/serv_top.v": """\
module serv_top (input wire clk, input wire i_rst, output reg [7:0] o_count);
  always @(posedge clk)
    if (i_rst) o_count <= 8'd0;
    else o_count <= o_count + 8'd1;
endmodule
""",
    "servile.core": """\
CAPI=2:
name: award-winning:serv:servile:1.4.0
filesets:
  rtl: {files: [servile/servile.v], file_type: verilogSource, depend: ["award-winning:serv:serv"]}
targets:
  default: {filesets: [rtl]}
  lint: {filesets: [rtl], flow: lint, flow_options: {tool: verilator}, toplevel: servile}
""",
    "servile/servile.v": """\
module servile (input wire clk, input wire i_rst, output wire o_bit);
  wire [7:0] count;
  serv_top cpu (.clk(clk), .i_rst(i_rst), .o_count(count));
  assign o_bit = ^count;
endmodule
""",
}


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    """A workspace with FuseSoC's configuration and a library."""
    folder = tmp_path / "workspace"
    for name, text in LIBRARY.items():
        path = folder / "fusesoc_libraries" / "serv" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    (folder / "fusesoc.conf").write_text("[library.serv]\nlocation = fusesoc_libraries/serv\n")
    return folder


def blocks(page: str) -> Iterator[tuple[str, str]]:
    """Yield each indented block without its indentation, after the sentence before it."""
    for found in re.finditer(r"([^\n]+)\n\n((?:    [^\n]*\n|\n(?=    ))+)", page):
        yield found[1], re.sub(r"^    ", "", found[2], flags=re.MULTILINE).rstrip("\n") + "\n"


def follow(page: str, workspace: Path) -> dict[str, subprocess.CompletedProcess[str]]:
    """Write the page's files and run its commands in order; return the result of each command."""
    done = {}
    for sentence, block in blocks(page):
        if name := re.search(r"Write `([^`]+)`:$", sentence):
            path = workspace / name[1]
            # The reader can rely only on the library's folders.
            assert path.parent.is_dir() or path.parent.parent.is_dir()
            path.parent.mkdir(exist_ok=True)
            path.write_text(block)
        elif sentence.endswith("Run"):
            for command in block.splitlines():
                if command.startswith("pip install"):
                    continue
                done[command] = run(command, workspace)
    return done


def run(command: str, workspace: Path) -> subprocess.CompletedProcess[str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("FUSESOC", "EDALIZE"))}
    variables = {
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        "PYTHONPATH": str(REPOSITORY),
        "FUSESOC_FIRM_CACHE": str(workspace.parent / "store"),
        "XDG_CACHE_HOME": str(workspace.parent / "cache"),
        # There is no server.
        "http_proxy": "http://127.0.0.1:9",
        "https_proxy": "http://127.0.0.1:9",
    }
    done = subprocess.run(
        ["sh", "-c", command],
        cwd=workspace,
        env=kept | variables,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    print(f"$ {command}\n{done.stdout}")
    return done


@needs_tools
def test_the_page(workspace: Path) -> None:
    page = PAGE.read_text(encoding="utf-8")
    lint = "fusesoc run --target=lint serv"
    assert f"`{lint}`" in page
    before = run(lint, workspace)
    assert before.returncode == 0
    done = follow(page, workspace)
    assert len(done) == 4
    assert all(item.returncode == 0 for item in done.values())

    assert run(lint, workspace).returncode == 0
    section = (workspace / "fusesoc.conf").read_text().partition("[library.firm]\n")[2]
    assert len(section.split("\n\n")[0].splitlines()) == 4

    core = (workspace / "fusesoc_libraries" / "serv" / "pose.core").read_text()
    assert len(core.splitlines()) == 5
    shown = next(item.stdout for command, item in done.items() if command.startswith("cat "))
    assert re.search(r"s_axis_tdata +: in +std_logic_vector\(31 downto 0\)", shown)
    for field in ("position_x", "orientation_w"):
        assert re.search(rf"{field} +: out +std_logic_vector\(63 downto 0\)", shown)

    built = next(item.stdout for command, item in done.items() if command.startswith("firm build"))
    for name in ("serv:1.4.0", "pose_register:1.0"):
        assert re.search(rf"^award-winning:serv:{name} +lint +ok ", built, re.MULTILINE)


def test_a_word_that_is_wrong(workspace: Path) -> None:
    page = PAGE.read_text(encoding="utf-8")
    until = page[: page.index("## 3.")].replace("`widht: 32`", "").replace("width: 32", "widht: 32")
    said = [item.stdout for item in follow(until, workspace).values() if item.returncode]
    expected = next(block for sentence, block in blocks(page) if sentence.endswith("prints")).strip()
    assert expected in said[0]
    assert "Traceback" not in said[0]
