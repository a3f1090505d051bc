"""A board: the connections of its FPGA, and the top level that fits a system to it.

A YAML file describes a board. The package's boards are in `fusesoc_firm/boards`; a core refers to any other board by a
path. A board without a processor has pins, and a link to the host or a chip with TCP/IP. On a board with a processor,
the system is part of a block design (`block_design`).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import Any

from fusesoc_firm.converter.vhdl import vhdl_type
from fusesoc_firm.system.boards.pll import PLL_TEMPLATES, Pll, megahertz, pll_configuration, pll_of
from fusesoc_firm.system.boards.processor import MOST_CLOCKS, PROCESSORS
from fusesoc_firm.system.derived.model import DerivedSystem, LinkKind, Phy
from fusesoc_firm.system.derived.timing import frequency
from fusesoc_firm.system.hardware.configuration import top_level_pins
from fusesoc_firm.system.hardware.interconnect import (
    ADDRESS_FAULT,
    CHIP_PINS,
    LINK_PINS,
    NETWORK_FAULTS,
    PHY_CLOCKS,
    PHY_PINS,
    phy_pins,
)
from fusesoc_firm.system.written.specification import AXI_STREAM, CHIPS, ETHERNET, PHYS, Specification
from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef, fail, nearest
from fusesoc_firm.text.naming import identifier, text_fault
from fusesoc_firm.text.yaml_sections import Section, key, read
from fusesoc_firm.text.yaml_text import Text, is_null, read_yaml
from fusesoc_firm.tools.flows import NETLIST, Flow
from fusesoc_firm.tools.open_flows import OPEN_FLOWS, REPORT

FOLDER = Path(__file__).resolve().parents[2] / "boards"
BOARD_TEMPLATE = "vhdl/board.vhd"

# The flag that selects the cells for pins with both edges (robot:net:firm_ddr) by flow.
_DDR_FLAGS = {"trellis": "ddr_ecp5"}
# Tools for systems whose streams are ports: Vivado places the system next to a processor, Quartus uses it unchanged.
VIVADO, QUARTUS = "vivado", "quartus"
# The keys of a board that each flow requires.
_NEEDED = {
    **{name: ("device",) * flow.needs_device for name, flow in OPEN_FLOWS.items()},
    VIVADO: ("part", "processor"),
    QUARTUS: ("device", "deviceFamily"),
}
_CLOCK, _OSCILLATOR = "clk", "oscillator"
_PHY_RESET = "phy_rst_n"
_PORTS = (
    *(_CLOCK, _OSCILLATOR, _PHY_RESET),
    *dict.fromkeys(name for pins in (*LINK_PINS.values(), CHIP_PINS) for name, _, _ in pins),
    *(name for pins in PHY_PINS.values() for name, _, _ in pins),
    *("led", "led_n", "reset", "reset_n"),
)
# Other names in the top level: signals, then the generic and labels.
_INNER_NAMES = (
    *("locked", "stable", "running_r", "button", "pressed", "miso", "error_r"),
    *("link_error", "network_error", "id_error", "frame_error"),
    *("debounce", "u_pll", "u_stable", "u_button", "start", "note_error", "u_phy_reset", "u_system"),
)
# Contacts bounce for up to about 10 ms, and PHYs need a reset of 10 ms. firm_debounce has a minimum number of cycles.
_DEBOUNCE_SECONDS = 0.01
_SHORTEST_DEBOUNCE = 4
# The optional keys of a board.
_OPTIONAL = {"uart_rts_n", "uart_cts_n", "spi_irq", "spi_rst_n"}
# The pins of each interconnect except ethernet, whose pins depend on the PHY.
_PINS = {**{kind.value: pins for kind, pins in LINK_PINS.items()}, **dict.fromkeys(CHIPS, CHIP_PINS)}


# Legal names of FPGAs, families and pins: scripts and constraints contain them without quotes.
_WORD = re.compile(r"[A-Za-z0-9][A-Za-z0-9 _.,:+/()-]*")


def word_fault(text: str) -> tuple[str, str] | None:
    """Return the reason why `text` is not a legal name of an FPGA, a family or a pin, or None if the name is legal."""
    if fault := text_fault(text):
        return fault
    legal = "legal here: letters, digits, blanks and '_.,:+/()-', starting with a letter or digit"
    return None if _WORD.fullmatch(text) else (f"cannot be '{text}'", legal)


@dataclass(frozen=True)
class BoardPin(Section):
    """An FPGA pin that the top level uses."""

    port: Text = key(
        "the connected port of the top level: a standard port, or a pin of an accelerator", is_required=True
    )
    site: Text = key("the FPGA manufacturer's name for the pin", is_required=True, rule=word_fault)
    standard: Text | None = key("the pin's electrical standard, if different from the board's", rule=word_fault)


@dataclass(frozen=True)
class Board(Section):
    """The contents of a board file."""

    description: Text = key("maker, board and FPGA", is_required=True)
    flow: Text = key("the Edalize flow that builds for the board", is_required=True, choices=tuple(_NEEDED))
    clock: Text = key("frequency of clk, such as 25 MHz", is_required=True)
    oscillator: Text | None = key("frequency of the pin oscillator, if a PLL makes clk of it")
    interconnect: Text = key(
        "the connection to the host or to a network", is_required=True, choices=(AXI_STREAM, *_PINS, ETHERNET)
    )
    phy: Text | None = key("the interface of the PHY, with interconnect ethernet", choices=PHYS)
    part: Text | None = key("the FPGA's name in Vivado", rule=word_fault)
    board_part: Text | None = key(
        "the board's name in Vivado, if Vivado sets up the processor", name="boardPart", rule=word_fault
    )
    processor: Text | None = key("the FPGA's processor", choices=tuple(PROCESSORS))
    standard: Text | None = key("electrical standard of the pins, for flows that need one", rule=word_fault)
    device: Text | None = key("the device, for flows that need one", rule=word_fault)
    device_family: Text | None = key(
        "the device's family, for flows that need one", name="deviceFamily", rule=word_fault
    )
    synth_options: tuple[Text, ...] = key("options of Yosys' synth command", name="synthOptions", form="texts")
    nextpnr_options: tuple[Text, ...] = key("options of nextpnr", name="nextpnrOptions", form="texts")
    loader: Text | None = key("the board's name in openFPGALoader, for firm load", rule=word_fault)
    pins: tuple[BoardPin, ...] = key("the pins that are used", form="sections", section=BoardPin)
    name: str = ""

    @property
    def is_linked(self) -> bool:
        """Whether pins connect the host or the network to the system."""
        return self.flow in OPEN_FLOWS

    @property
    def edalize_flow(self) -> Flow:
        """The flow that builds for the board, with its options; Edalize does not have one for Quartus."""
        options: dict[str, str | Sequence[str] | None] = {
            "frontends": [NETLIST] if self.is_linked else None,
            "part": self.part,
            "board_part": self.board_part,
            # Only if Vivado manages the sources can a block design refer to modules by name.
            "source_mgmt_mode": "All" if self.flow == VIVADO else None,
            "yosys_synth_options": self.synth_options,
            "nextpnr_options": self._nextpnr_options(),
            "device": self.device,
            "family" if self.flow == QUARTUS else "device_family": self.device_family,
        }
        plain = {name: _plain(value) for name, value in options.items() if value}
        return Flow(str(self.flow), plain, is_tool=self.flow == QUARTUS, clocks=self._clocks())

    def _nextpnr_options(self) -> Sequence[str]:
        """The options of nextpnr: the board's, the report and, if the constraints cannot state it, the clock."""
        if not self.is_linked:
            return ()
        needed = {"--report": REPORT}
        if not OPEN_FLOWS[self.flow].is_clocked:
            needed["--freq"] = self._clocks()[_CLOCK]
        added = [item for item in needed.items() if item[0] not in self.nextpnr_options]
        return [*self.nextpnr_options, *chain.from_iterable(added)]

    def _clocks(self) -> Mapping[str, str]:
        """The clocks of the system in MHz: clk, and those of the PHY. Without pins, other constraints state them."""
        clock = clock_of(self) if self.is_linked else None
        if clock is None:
            return {}
        return {_CLOCK: megahertz(clock), **{name: str(mhz) for name, mhz in _line_clocks(self).items()}}

    @property
    def clock_port(self) -> str:
        """The port of the pin with the board's clock."""
        return _OSCILLATOR if self.oscillator else _CLOCK

    @property
    def ddr_flag(self) -> str | None:
        """The flag of the board's target that selects the cells for pins with both edges, if there are such pins."""
        return _DDR_FLAGS[self.flow] if self.phy == Phy.RGMII.value else None

    @property
    def host_pins(self) -> Sequence[tuple[str, str, str]]:
        """The pins of the interconnect: name, direction and type."""
        return phy_pins(Phy(str(self.phy))) if self.phy else _PINS[self.interconnect]


@dataclass(frozen=True)
class _Port:
    """An accelerator's pin at the top level; `width` is None for a scalar, and `what` is the pin's name in messages."""

    name: str
    direction: str
    width: int | None
    what: str
    source: SourceRef | None

    def bits(self) -> list[str]:
        """Return the names of all bits; the board assigns an FPGA pin to each bit."""
        return _bits(self.name, self.width)


def _bits(name: str, width: int | None) -> list[str]:
    return [name] if width is None else [f"{name}[{bit}]" for bit in range(width)]


def boards() -> tuple[str, ...]:
    """Return the names of the package's boards."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.yaml")))


def _plain(value: str | Sequence[str]) -> str | list[str]:
    """Return a text or texts without their places."""
    return str(value) if isinstance(value, str) else list(map(str, value))


def board_path(name: str, folder: Path) -> Path:
    """Return the path of the package's board with this name; the name of a YAML file is relative to `folder`."""
    return folder / name if name.endswith((".yaml", ".yml")) else FOLDER / f"{name}.yaml"


def read_board(name: str, folder: Path = Path()) -> Board:
    """Read the board file that `board_path` identifies; may raise `InputError`."""
    path = board_path(name, folder)
    if not path.is_file():
        fail(f"unknown board '{name}'", hint=nearest(name, boards()) + "; the path of a YAML file is legal, too")
    faults = Diagnostics()
    text = read_yaml(path, name if path.parent != FOLDER else path.name, faults)
    if text.root is None or is_null(text.root):
        faults.raise_if_any()
        fail(f"{name} is empty; a board needs the keys 'description', 'flow', 'clock' and 'interconnect'")
    board = read(Board, text.root, text, faults, "a board")
    if board.is_sound:
        _check_keys(board, faults)
        _pll(board, faults)
    if board.is_sound and board.is_linked:
        _check_pins(board, faults)
    elif board.is_sound:
        _check_streams(board, faults)
    faults.raise_if_any()
    return replace(board, name=identifier(path.stem).lower())


def _pll(board: Board, faults: Diagnostics) -> Pll | None:
    """Return the PLL that generates clk, or None if the board has no PLL; note its faults."""
    if board.oscillator is None:
        return None
    if board.flow not in PLL_TEMPLATES:
        message = f"boards with flow '{board.flow}' have no known PLL"
        faults.error(message, board.oscillator.source, f"'oscillator' is legal with flow {', '.join(PLL_TEMPLATES)}")
        return None
    oscillator, clock = frequency("oscillator", board.oscillator, faults), frequency("clock", board.clock, faults)
    if oscillator is None or clock is None:
        return None
    pll = pll_of(oscillator, clock)
    if pll is None:
        message = f"no PLL makes 'clock: {board.clock}' from an oscillator of {board.oscillator}"
        faults.error(message, board.clock.source, "use a frequency with a simple ratio to the oscillator's")
    return pll


def _check_pins(board: Board, faults: Diagnostics) -> None:
    if board.interconnect == AXI_STREAM:
        faults.error(
            f"boards with flow '{board.flow}' have no processor for streams",
            board.interconnect.source,
            nearest("", (*_PINS, ETHERNET)),
        )
        return
    if (board.interconnect == ETHERNET) != (board.phy is not None):
        place = board.phy.source if board.phy else board.interconnect.source
        faults.error(f"the key 'phy' and interconnect '{ETHERNET}' need each other", place)
        return
    if board.phy == Phy.RGMII.value and board.flow not in _DDR_FLAGS:
        message = f"boards with flow '{board.flow}' have no cells for phy '{board.phy}'"
        faults.error(message, board.phy.source, nearest("", [phy for phy in PHYS if phy != board.phy]))
        return
    seen: dict[str, Text] = {}
    for pin in board.pins:
        twin = seen.setdefault(pin.port.lower(), pin.port)
        if twin is not pin.port:
            faults.error(f"port '{pin.port}' already has a pin, at {twin.source}", pin.port.source)
    _check_ports(board, seen, faults)


def _check_ports(board: Board, pins: Mapping[str, Text], faults: Diagnostics) -> None:
    """Note missing pins, and pins of ports that the board does not have; `pins` contains the ports with a pin."""
    for port, value, name in (_OSCILLATOR, board.oscillator, "oscillator"), (_PHY_RESET, board.phy, "phy"):
        if value is None and (unused := pins.get(port)):
            faults.error(f"the pin '{port}' needs the key '{name}'", unused.source)
    if board.oscillator and (clock := pins.get(_CLOCK)):
        faults.error(f"a PLL makes '{_CLOCK}', so it has no pin", clock.source, f"the pin is '{_OSCILLATOR}'")
    source = board.pins[-1].source if board.pins else board.source
    names = [name for name, _, _ in board.host_pins]
    if board.phy:
        names = [bit for name, _, bits in PHY_PINS[Phy(str(board.phy))] for bit in _bits(name, bits)]
    needed = {board.clock_port, *names} - _OPTIONAL
    for port in sorted(needed - pins.keys()):
        faults.error(
            f"the board has no pin for '{port}'", source, f"interconnect '{board.interconnect}' needs this pin"
        )


def _check_keys(board: Board, faults: Diagnostics) -> None:
    """Note the keys that the board's flow needs and that are missing."""
    given = {
        "part": board.part,
        "processor": board.processor,
        "device": board.device,
        "deviceFamily": board.device_family,
    }
    for name in _NEEDED[board.flow]:
        if given[name] is None:
            faults.error(f"a board with flow '{board.flow}' needs the key '{name}'", board.source)


def _check_streams(board: Board, faults: Diagnostics) -> None:
    if board.interconnect != AXI_STREAM:
        faults.error(
            f"flow '{board.flow}' supports only streams", board.interconnect.source, f"legal here: {AXI_STREAM}"
        )
    if board.pins:
        message = f"flow '{board.flow}' does not support pins"
        faults.error(message, board.place("pins"), "add constraints to a fileset of the core")


def on_board(specification: Specification, board: Board) -> Specification:
    """Return the specification of the system on the board, with the board's interconnect.

    On a board without a processor, the clock pin determines the frequency of clk. On other boards, a PLL provides the
    frequency that the specification requests.
    """
    clock = board.clock if board.is_linked else specification.project.clock or board.clock
    project = replace(specification.project, interconnect=board.interconnect, clock=clock)
    if board.phy and project.network:
        project = replace(project, network=replace(project.network, phy=board.phy))
    return replace(specification, project=project)


def clock_of(board: Board) -> Fraction | None:
    """Return the frequency of clk in Hz that a board file names; None if it is illegal."""
    return frequency("clock", board.clock, Diagnostics())


def check_fits(system: DerivedSystem, board: Board) -> None:
    """Raise `InputError` if the clocks or pins of a system and of its board do not match."""
    if system.id_bytes > 1:
        fail(f"board '{board.name}' has no host for a system with 'idBytes: {system.id_bytes}'")
    clocks = 1 + len(system.clocks)
    if board.processor and clocks > MOST_CLOCKS:
        fail(f"board '{board.name}' has at most {MOST_CLOCKS} clocks, including clk; the system has {clocks}")
    if not board.is_linked:
        return
    faults = Diagnostics()
    for clock in system.clocks:
        faults.error(f"board '{board.name}' has no clock '{clock.name}'", hint="this board has only the clock clk")
    _check_places(_accelerator_pins(system), board, faults)
    faults.raise_if_any()


def _check_places(pins: Sequence[_Port], board: Board, faults: Diagnostics) -> None:
    """Note every accelerator pin without a site on the board, and every port of the board file without a pin."""
    places = {pin.port.lower() for pin in board.pins}
    for pin in pins:
        if pin.name in (*_PORTS, *_INNER_NAMES):
            faults.error(f"{pin.what} has the name '{pin.name}', which is reserved for boards", pin.source)
        elif missing := next((bit for bit in pin.bits() if bit not in places), None):
            hint = f"add '{{port: {missing}, site: ...}}' to your own board file"
            faults.error(f"{pin.what} has no site on board '{board.name}'", pin.source, hint)
    lines = [bit for phy in PHY_PINS.values() for name, _, bits in phy for bit in _bits(name, bits)]
    known = (*_PORTS, *lines, *(bit for pin in pins for bit in pin.bits()))
    for place in board.pins:
        if place.port.lower() not in known:
            message = f"the system has no port '{place.port}'"
            faults.error(message, place.port.source, nearest(place.port, known))


def board_entity(system: DerivedSystem, board: Board) -> str:
    """Return the name of a system's top-level entity on a board or, next to a processor, of the block design."""
    return system.entity if board.flow == QUARTUS else f"{system.name}_{board.name}"


def board_configuration(system: DerivedSystem, board: Board) -> dict[str, Any]:
    """Return the configuration of the top level and of its constraints."""
    assert system.clock is not None
    clock_hz = int(system.clock)
    entity, pll = board_entity(system, board), _pll(board, Diagnostics())
    ports = {pin.port.lower().partition("[")[0] for pin in board.pins}
    pins = _accelerator_pins(system)
    link = [(name, direction) for name, direction, _ in board.host_pins if name in ports]
    types = {name: type_.partition(" :=")[0] for name, _, type_ in board.host_pins}
    is_spi = board.interconnect == LinkKind.SPI.value
    own = [*((name, "out") for name in (_PHY_RESET, "led", "led_n")), *((name, "in") for name in ("reset", "reset_n"))]
    declared = [(board.clock_port, "in"), *link, *((name, direction) for name, direction in own if name in ports)]
    typed = [(name, direction, types.get(name, vhdl_type(None))) for name, direction in declared]
    typed += [(pin.name, pin.direction, vhdl_type(pin.width)) for pin in pins]
    return {
        "entity": entity,
        "system": system.entity,
        "description": str(board.description),
        "clock_hz": clock_hz,
        "error_count": len(system.error_blocks),
        "ports": [{"name": name, "direction": direction, "type": type_} for name, direction, type_ in typed],
        # The pad of spi_miso is at the top level.
        "handed_on": [*(name for name, _ in link if not (is_spi and name == "spi_miso")), *(pin.name for pin in pins)],
        "has_button": bool(ports & {"reset", "reset_n"}),
        "is_timed": bool(ports & {"reset", "reset_n", _PHY_RESET}),
        "pll": pll_configuration(pll, f"{entity}_pll") if pll else None,
        "debounce": max(_SHORTEST_DEBOUNCE, round(clock_hz * _DEBOUNCE_SECONDS)),
        **{name: name in ports for name, _ in own},
        "is_uart": board.interconnect == LinkKind.UART.value,
        "is_spi": is_spi,
        "has_link": system.link is not None,
        "network": {"fault_count": len(NETWORK_FAULTS), "address_fault": ADDRESS_FAULT} if board.phy else None,
        "clocks": [
            {"port": board.clock_port, "mhz": megahertz(pll.oscillator if pll else system.clock)},
            *({"port": name, "mhz": mhz} for name, mhz in _line_clocks(board).items()),
        ],
        "pins": [
            {
                "port": str(pin.port).lower(),
                "site": str(pin.site),
                "standard": _standard(pin, board),
            }
            for pin in board.pins
        ],
    }


def _line_clocks(board: Board) -> Mapping[str, int]:
    """Return the line clocks that the PHY provides, in MHz."""
    return PHY_CLOCKS[Phy(str(board.phy))] if board.phy else {}


def _standard(pin: BoardPin, board: Board) -> dict[str, str] | None:
    standard = pin.standard or board.standard
    return {"port": str(pin.port).lower(), "name": str(standard)} if standard else None


def _accelerator_pins(system: DerivedSystem) -> list[_Port]:
    """Return the accelerators' pins as ports of the top level."""
    names = top_level_pins(system)
    return [
        _Port(
            # GHDL writes names in lower case.
            names[block.block, pin.name].lower(),
            str(pin.direction),
            pin.bits,
            f"pin '{pin.name}' of '{block.block}'",
            pin.name.source,
        )
        for block in system.accelerators
        for pin in block.type.accelerator.pins
    ]
