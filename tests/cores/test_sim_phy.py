"""The simulated PHY and its twin in Verilog: where a file of answers ends, both end, and their reports agree."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.hdl.ghdl import CORES, Library, core_files

FRAME = bytes(range(1, 41))
# An environment that has events of its own, and no end.
_BENCH = """
library ieee;
use ieee.std_logic_1164.all;
library firm;

entity bench is
  generic (BITS : integer := 8; IS_DDR : boolean := false);
end entity bench;

architecture simulation of bench is
  signal other : std_logic := '0';
  signal clk   : std_logic;
  signal rst_n : std_logic;
  signal dv    : std_logic;
  signal data  : std_logic_vector(BITS-1 downto 0);
begin
  other <= not other after 3 ns;
  u_phy : entity firm.firm_sim_phy
    generic map (BITS => BITS, IS_DDR => IS_DDR)
    port map (clk => clk, rst_n => rst_n, rx_dv => dv, rxd => data, tx_en => dv, txd => data);
end architecture simulation;
"""
_VERILOG = """
`timescale 1ns / 1ps
module bench #(parameter BITS = 8, parameter IS_DDR = 0);
  reg other = 0;
  always #3 other = !other;
  wire clk, rst_n, dv;
  wire [BITS-1:0] data;
  firm_sim_phy #(.BITS(BITS), .IS_DDR(IS_DDR)) phy (
    .clk(clk), .rst_n(rst_n), .rx_dv(dv), .rxd(data), .tx_en(dv), .txd(data)
  );
endmodule
"""
# File descriptors 3 and 4 are the files that are named.
_OPEN = (
    "import os, sys; "
    "answers, reports = os.open(sys.argv[1], os.O_RDONLY), os.open(sys.argv[2], os.O_CREAT | os.O_WRONLY); "
    "answers, reports = os.dup2(answers, 10), os.dup2(reports, 11); "
    "os.dup2(10, 3); os.dup2(11, 4); os.execvp(sys.argv[3], sys.argv[3:])"
)
ANSWERS = {
    "at once": b"",
    "in a size": b"\0\0\x28",
    "in a frame": b"\0\0\x28\0" + FRAME[:7],
    "after a frame": b"\0\0\x28\0" + FRAME,
    "after a pause": b"\x28\0" + FRAME + b"\0\0",
}


def _vhdl(folder: Path, bits: int, *, is_ddr: bool = False) -> Sequence[str]:
    library = Library("firm", folder)
    library.analyse(core_files("sim/phy"))
    library.make()
    (folder / "bench.vhd").write_text(_BENCH, encoding="ascii")
    options = ["--std=93", f"-P{folder}", f"--workdir={folder}"]
    subprocess.run(["ghdl", "-a", *options, "bench.vhd"], cwd=folder, check=True)
    subprocess.run(["ghdl", "-e", *options, "bench"], cwd=folder, check=True)
    return ["ghdl", "-r", *options, "bench", f"-gBITS={bits}", f"-gIS_DDR={str(is_ddr).lower()}"]


def _verilog(folder: Path, bits: int, *, is_ddr: bool = False) -> Sequence[str]:
    if not shutil.which("iverilog"):
        pytest.skip("iverilog is not installed")
    (folder / "bench.v").write_text(_VERILOG, encoding="ascii")
    source = CORES / "sim" / "rtl" / "firm_sim_phy.v"
    options = ["-g2012", "-s", "bench", f"-Pbench.BITS={bits}", f"-Pbench.IS_DDR={is_ddr:d}", "-o", "bench.vvp"]
    subprocess.run(["iverilog", *options, "bench.v", source], cwd=folder, check=True)
    return ["vvp", "-n", "bench.vvp"]


@pytest.fixture(params=[_vhdl, _verilog], ids=["VHDL", "Verilog"])
def made(request: pytest.FixtureRequest) -> object:
    return request.param


def _run(command: Sequence[str], folder: Path, answers: bytes) -> tuple[subprocess.CompletedProcess[str], bytes]:
    (folder / "answers").write_bytes(answers)
    (folder / "reports").unlink(missing_ok=True)
    opened = [sys.executable, "-c", _OPEN, "answers", "reports", *command]
    done = subprocess.run(opened, cwd=folder, capture_output=True, text=True, check=False)
    return done, (folder / "reports").read_bytes() if (folder / "reports").exists() else b""


def _frames(reports: bytes) -> tuple[int, list[bytes]]:
    """The number of questions, and the frames between their ends."""
    frames: list[bytes] = []
    questions, content, place = 0, b"", 0
    while place < len(reports):
        kind = reports[place : place + 1]
        if kind == b"w":
            questions, place = questions + 1, place + 5
        elif kind == b"b":
            content, place = content + reports[place + 1 : place + 2], place + 2
        else:
            assert kind == b"e"
            frames, content, place = [*frames, content], b"", place + 1
    assert not content
    return questions, frames


@pytest.mark.parametrize(("bits", "is_ddr"), [(2, False), (4, False), (8, False), (4, True)])
def test_the_simulation_ends_with_the_file(made: object, tmp_path: Path, bits: int, is_ddr: bool) -> None:
    assert callable(made)
    command = made(tmp_path, bits, is_ddr=is_ddr)
    wanted = {
        "at once": (1, []),
        "in a size": (2, []),
        "in a frame": (2, []),
        "after a frame": (3, [FRAME]),
        "after a pause": (3, [FRAME]),
    }
    for name, answers in ANSWERS.items():
        done, reports = _run(command, tmp_path, answers)
        assert done.returncode == 0, done.stdout + done.stderr
        assert _frames(reports) == wanted[name], name


@pytest.mark.parametrize("bits", [1, 3, 16])
def test_an_illegal_width_is_refused(made: object, tmp_path: Path, bits: int) -> None:
    assert callable(made)
    done, _ = _run(made(tmp_path, bits), tmp_path, b"")
    assert done.returncode != 0
    assert f"firm_sim_phy: BITS is {bits}; legal: 2, 4, 8" in done.stdout + done.stderr


def test_both_edges_need_four_bits(made: object, tmp_path: Path) -> None:
    assert callable(made)
    done, _ = _run(made(tmp_path, 8, is_ddr=True), tmp_path, b"")
    assert done.returncode != 0
    assert "firm_sim_phy: BITS is 8; legal with IS_DDR: 4" in done.stdout + done.stderr
