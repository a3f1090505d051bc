"""A system on a board: its top level in simulation, and its bitstream."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.system.boards.board import read_board
from fusesoc_firm.tools import manifest
from fusesoc_firm.tools.open_flows import OPEN_FLOWS
from fusesoc_firm.tools.programs import missing
from tests.hdl.ghdl import REPOSITORY, Library, core_files
from tests.system.simulated.systems import build, call, generate_system

OBSTACLE = REPOSITORY / "specs" / "obstacle"


def _needs(*programs: str) -> pytest.MarkDecorator:
    absent = missing(programs)
    return pytest.mark.skipif(bool(absent), reason=f"not installed: {' '.join(absent)}")


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Library:
    folder = tmp_path_factory.mktemp("board")
    request = call(OBSTACLE / "obstacle.yaml", OBSTACLE / "stimuli.yaml", OBSTACLE / "model.py", board="icebreaker")
    system = build(request, folder)
    # It instantiates what is generated, so it is no file that could be read alone.
    bench = folder / "board_tb.vhd"
    bench.write_text((Path(__file__).parent / "board_tb.vhd.mustache").read_text(encoding="utf-8"), encoding="utf-8")
    system.work.analyse([bench])
    return system.work


@pytest.mark.one_in(2)
@pytest.mark.parametrize("pressed", [0, 300])
def test_a_board_answers_over_its_serial_line(work: Library, pressed: int) -> None:
    result = work.run("board_tb", {"PRESSED_CYCLES": pressed, "SEED": 5})
    assert result.exit_code == 0, result.output
    assert result.output.splitlines()[-1] == "PASS 19/19"


def test_the_light_shows_a_broken_frame(work: Library, tmp_path: Path) -> None:
    """A payload of one byte is no sensor_msgs/Range."""
    (tmp_path / "stimulus.txt").write_text("> broken\n  00 01000000 00\n", encoding="ascii")
    (tmp_path / "expected.txt").write_text("", encoding="ascii")
    result = work.run("board_tb", {}, directory=tmp_path)
    assert result.exit_code != 0
    assert "frame_error(0) pulses" in result.output


def _board(name: str, *marks: pytest.MarkDecorator) -> Any:
    """A parameter: a board with the smallest system, unless the programs for it are missing."""
    return pytest.param(name, marks=[_needs(*OPEN_FLOWS[read_board(name).flow].programs), *marks])


# A board of each family.
BOARDS = [
    _board("icebreaker"),
    *(
        _board(name, pytest.mark.thorough)
        for name in ("crosslink_nx_evn", "gatemate_a1_evb", "step_mxo2", "tangnano9k", "ulx3s")
    ),
]


@pytest.mark.check
@pytest.mark.parametrize("board", BOARDS)
def test_a_bitstream_is_the_same_again(tmp_path: Path, board: str) -> None:
    builds = [_build(tmp_path / name, board) for name in ("first", "second")]
    streams = [_bitstream(work) for work in builds]
    assert streams[0] == streams[1]
    assert len(streams[0]) > 40_000
    # Made by the same tools, and both say so.
    manifests = [manifest.read(work) for work in builds]
    assert manifests[0] == manifests[1]
    assert {"ghdl", *OPEN_FLOWS[read_board(board).flow].programs} <= manifests[0].keys()
    for report in (json.loads((work / "report.json").read_text(encoding="utf-8")) for work in builds):
        assert all(clock["achieved"] >= clock["constraint"] for clock in report["fmax"].values())


@pytest.mark.thorough
@pytest.mark.parametrize("board", BOARDS)
def test_a_wrong_constraint_of_the_clock_ends_the_build(tmp_path: Path, board: str) -> None:
    """Whether the file with the pins states the clock, or an option of nextpnr."""
    flow, megahertz = OPEN_FLOWS[read_board(board).flow], str(read_board(board).clock).split()[0]
    work = _build(tmp_path, board, stages=["--setup"])
    stating = next(work.glob(f"src/*/{board}.{flow.constraints}")) if flow.is_clocked else work / "Makefile"
    text = stating.read_text(encoding="utf-8")
    wrong = re.sub(rf"((?:--freq|set_frequency clk|FREQUENCY PORT \"clk\") ){megahertz}\b", r"\g<1>11", text)
    assert wrong != text
    stating.write_text(wrong, encoding="utf-8")
    done = subprocess.run(["make"], cwd=work, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert f"ERROR: clock 'clk' was judged by 11 MHz; the board's has {megahertz} MHz" in done.stdout
    assert not [*work.glob(f"*{flow.bitstream}")]


@pytest.mark.thorough
@_needs("yosys", "nextpnr-ecp5", "ecppack")
def test_a_node_by_ethernet_meets_its_clocks(tmp_path: Path) -> None:
    """Those of the system, which a PLL makes, and of the line."""
    work = _build(tmp_path, "ecp5_versa", "quat2euler_ethernet")
    clocks = json.loads((work / "report.json").read_text(encoding="utf-8"))["fmax"]
    limits = {name: round(clock["constraint"]) for name, clock in clocks.items()}
    assert limits == {"$glbnet$clk": 125, "$glbnet$rgmii_rx_clk$TRELLIS_IO_IN": 125}
    assert all(clock["achieved"] >= clock["constraint"] for clock in clocks.values())
    assert len(_bitstream(work)) > 100_000


def _build(folder: Path, board: str, system: str = "obstacle", stages: Sequence[str] = ("--setup", "--build")) -> Path:
    """The work folder of a bitstream of one of the systems in specs."""
    command = [sys.executable, "-m", "fusesoc.main", "run", *stages, f"--build-root={folder}"]
    done = subprocess.run(
        [*command, f"--target={board}", f"robot:sys:{system}"],
        cwd=REPOSITORY,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY), "FUSESOC_FIRM_CACHE": str(folder.parent / "store")},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    (work,) = folder.glob(f"*/{board}")
    return work


def _bitstream(work: Path) -> bytes:
    (stream,) = (path for path in work.iterdir() if path.suffix in (".bin", ".bit", ".fs"))
    return stream.read_bytes()


# A PLL that locks after 1 us, and the system without its inside.
STARTING_BOARD = """\
library ieee;
use ieee.std_logic_1164.all;

entity quat2euler_ethernet_ecp5_versa_pll is
  port (
    oscillator : in  std_logic;
    clk        : out std_logic := '0';
    locked     : out std_logic := '0'
  );
end entity quat2euler_ethernet_ecp5_versa_pll;

architecture simulation of quat2euler_ethernet_ecp5_versa_pll is

  signal clk_r : std_logic := '0';

begin

  clk_r  <= not clk_r after 4 ns when now < 9 us else '0';
  clk    <= clk_r;
  locked <= '1' after 1 us;

end architecture simulation;

library ieee;
use ieee.std_logic_1164.all;

entity quat2euler_ethernet_system is
  port (
    clk, rst_n                               : in  std_logic;
    rgmii_rx_clk, rgmii_rx_ctl               : in  std_logic;
    rgmii_rxd                                : in  std_logic_vector(3 downto 0);
    rgmii_tx_clk, rgmii_tx_ctl               : out std_logic;
    rgmii_txd                                : out std_logic_vector(3 downto 0);
    network_error                            : out std_logic_vector(10 downto 0);
    id_error                                 : out std_logic;
    frame_error                              : out std_logic_vector(0 downto 0);
    frame_error_code                         : out std_logic_vector(7 downto 0)
  );
end entity quat2euler_ethernet_system;

architecture simulation of quat2euler_ethernet_system is
begin

  rgmii_tx_ctl  <= rst_n;
  network_error <= (others => '0');
  id_error      <= '0';
  frame_error   <= "0";

end architecture simulation;
"""
STARTING_BENCH = """\
library ieee;
use ieee.std_logic_1164.all;

entity starting_tb is
end entity starting_tb;

architecture simulation of starting_tb is

  signal reset_n   : std_logic := '1';
  signal rst_n     : std_logic;
  signal phy_rst_n : std_logic;

begin

  u_board : entity work.quat2euler_ethernet_ecp5_versa
    generic map (DEBOUNCE => 50)
    port map (
      oscillator => '0', rgmii_rx_clk => '0', rgmii_rx_ctl => '0', rgmii_rxd => "0000", rgmii_tx_clk => open,
      rgmii_tx_ctl => rst_n, rgmii_txd => open, phy_rst_n => phy_rst_n, led_n => open, reset_n => reset_n);

  reset_n <= '0' after 5 us, '1' after 6 us;

  tell : process (rst_n, phy_rst_n)
  begin
    report "system " & std_logic'image(rst_n) & " phy " & std_logic'image(phy_rst_n) & " at " & time'image(now);
  end process tell;

end architecture simulation;
"""


def test_a_phy_leaves_its_reset_after_the_clock_is_stable(tmp_path: Path) -> None:
    """The PLL locks at 1 us, and the button is pressed from 5 to 6 us; cycles of 8 ns."""
    top = "quat2euler_ethernet_ecp5_versa"
    generate_system(REPOSITORY / "specs" / "quat2euler" / "quat2euler_ethernet.yaml", tmp_path, "ecp5_versa")
    file = tmp_path / f"{top}.vhd"
    file.write_text(file.read_text(encoding="utf-8").replace(": component", ": entity work."), encoding="utf-8")
    (tmp_path / "parts.vhd").write_text(STARTING_BOARD, encoding="ascii")
    (tmp_path / "bench.vhd").write_text(STARTING_BENCH, encoding="ascii")
    Library("firm", tmp_path).analyse(core_files("cdc/sync", "cdc/debounce"))
    work = Library("work", tmp_path)
    work.analyse([tmp_path / f"{name}.vhd" for name in ("parts", top, "bench")])
    result = work.run("starting_tb")
    seen = re.findall(r"system '(.)' phy '(.)' at ([1-9]\d*)000000 fs", result.output)
    assert [f"{system}{phy}" for system, phy, _ in seen] == ["10", "11", "01", "00", "10", "11"], result.output
    started, phy_started, stopped, phy_stopped, again, phy_again = (int(time) for *_, time in seen)
    synchroniser, start, debounce = 3 * 8, 16 * 8, 50 * 8
    assert 0 <= started - (1000 + start) <= synchroniser
    assert 0 <= stopped - (5000 + debounce) <= 2 * synchroniser
    assert 0 <= again - (6000 + debounce + start) <= 2 * synchroniser
    for system, phy in (started, phy_started), (stopped, phy_stopped), (again, phy_again):
        assert 0 <= phy - (system + debounce) <= synchroniser


SPI_BOARD = """\
description: A board whose host shares its bus
flow: trellis
clock: 25 MHz
interconnect: spi
pins:
  - {port: clk, site: A1}
  - {port: spi_sclk, site: A2}
  - {port: spi_cs_n, site: A3}
  - {port: spi_mosi, site: A4}
  - {port: spi_miso, site: A5}
  - {port: reset, site: A6}
"""
SHARED_BUS = """\
library ieee;
use ieee.std_logic_1164.all;
library firm;

entity bus_tb is
end entity bus_tb;

architecture simulation of bus_tb is

  signal clk  : std_logic := '0';
  signal cs_n : std_logic := '1';
  signal miso : std_logic;

begin

  clk <= not clk after 20 ns when now < 4 us else '0';

  u_board : entity work.obstacle_board
    port map (clk => clk, spi_sclk => '0', spi_cs_n => cs_n, spi_mosi => '0', spi_miso => miso, reset => '0');

  -- Another device on the wire.
  miso <= '0' when cs_n = '1' else 'Z';

  select_board : process
  begin
    for selection in 1 to 3 loop
      wait for 1 us;
      assert miso = '0' report "the board drives the bus without being selected" severity failure;
      cs_n <= '0';
      wait for 100 ns;
      assert miso = '1' report "the board does not answer" severity failure;
      cs_n <= '1';
    end loop;
    report "PASS";
    wait;
  end process select_board;

end architecture simulation;
"""


@_needs("yosys")
def test_a_board_shares_the_wire_to_the_master(tmp_path: Path) -> None:
    """The answer to a selection begins with a one, 80 hex, and another device drives the wire before and after it."""
    (tmp_path / "board.yaml").write_text(SPI_BOARD, encoding="utf-8")
    board = str(tmp_path / "board.yaml")
    request = call(OBSTACLE / "obstacle.yaml", OBSTACLE / "stimuli.yaml", OBSTACLE / "model.py", board=board)
    folder = tmp_path / "work"
    system = build(request, folder)
    (folder / "bus_tb.vhd").write_text(SHARED_BUS, encoding="utf-8")
    system.work.analyse([folder / "bus_tb.vhd"])
    result = system.work.run("bus_tb")
    assert result.exit_code == 0 and "PASS" in result.output, result.output
    # The pad's buffer is at the top level.
    system.use_real_synchronisers()
    netlist = folder / "board.v"
    netlist.write_text(system.work.synthesise("obstacle_board", language="verilog"), encoding="utf-8")
    script = f"read_verilog {netlist}; hierarchy -top obstacle_board; proc; tribuf"
    done = subprocess.run(
        ["yosys", "-q", "-p", f"{script}; select -assert-count 1 obstacle_board/t:$tribuf"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
