"""The `.core` file of a system, with all targets that the system supports.

The upper part of the file is generated once; after that, the author maintains it. The targets are regenerated from a
template, so that existing systems also receive new targets. Targets that the author added under other names are kept.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath

from fusesoc_firm.core.core_reader import read_core
from fusesoc_firm.system.boards.board import QUARTUS, VIVADO, Board, board_entity, boards, read_board
from fusesoc_firm.system.derived.link import may_be_linked
from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.system.hardware.verilog_bench import translated_unit
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.system.written.specification import AXI_STREAM, CHIPS, ETHERNET, LINKS
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.naming import text_fault
from fusesoc_firm.text.quoting import yaml_list, yaml_scalar
from fusesoc_firm.text.render import render
from fusesoc_firm.tools.simulators import SIMULATORS, Simulator, default_simulator, fitting

HEAD_TEMPLATE = "core/system.core"
TARGETS_TEMPLATE = "core/targets.core"
BENCH_TEMPLATE = "core/cocotb.core"

# Yosys' names of FPGA families, with the options of the synth command: each family gets a target synth_<name>.
FAMILIES = [
    {"name": "xilinx", "description": "Xilinx UltraScale+", "options": "[-family, xcup, -flatten, -abc9]"},
    {"name": "ecp5", "description": "Lattice ECP5", "options": "[-abc9]"},
    {"name": "ice40", "description": "Lattice iCE40 UltraPlus", "options": "[-abc9, -device, u, -dsp]"},
    {"name": "gowin", "description": "Gowin", "options": "[]"},
]
# The generator instances that the targets use.
_SYSTEM, _SIMULATION = "system", "simulation"
# The core with the generator `far`, and the core that had this generator before version 0.2.0.
_SYSTEM_CORE, _GENERATORS = "robot:firm:firm_system", "robot:firm:generators"
# The simulator of an emulated board's hardware, and the project keys that the emulation replaces. A bit on the line
# takes ten cycles of this clock; the line's speed does not affect the emulated processor.
EMULATING = "verilator"
EMULATED = {"interconnect": "uart", "clock": "10 MHz"}
# The target of a simulated board with a chip or a PHY, and its clock: the node runs roughly at the pace of its peers.
NETWORK = "network"
NETWORK_HERTZ = {**dict.fromkeys(CHIPS, 1_000_000), ETHERNET: 250_000}
_SECTION = re.compile(r"^targets:[^\n]*\n((?:[ \t#][^\n]*\n|\n)*)", re.MULTILINE)
# A target with the comment above it; blank lines separate targets.
_TARGET = re.compile(r"^(?:  #[^\n]*\n)*  (\S+):[^\n]*\n(?:(?: {3,}[^\n]*| *)\n)*", re.MULTILINE)


@dataclass(frozen=True)
class CoreOptions:
    """The options of a new `.core` that the specification does not determine; paths are relative to the core.

    `bench` is the name of a bench in cocotb, which reads specification, stimuli and model.
    """

    name: str = ""
    description: str = ""
    depend: Sequence[str] = ()
    stimuli: str = "stimuli.yaml"
    model: str = "model.py"
    environment: Sequence[str] = ()
    paths: Sequence[str | Path] = ()
    distro: str = ""
    bench: str = ""


def core_text(loaded: LoadedSystem, spec: Path, path: Path, options: CoreOptions) -> str:
    """Return the text of the `.core` at `path`: a new core for a specification, or an existing core with new targets.

    The `paths` of `options` are relative to the current folder. May raise `InputError`.
    """
    if path.exists():
        return updated_core(loaded.system, path)
    folder = path.absolute().parent
    options = replace(
        options,
        depend=[*options.depend, *loaded.specification.message_cores],
        paths=[os.path.relpath(item, folder) for item in options.paths],
    )
    return new_core(loaded.system, os.path.relpath(spec, folder), options)


def new_core(system: DerivedSystem, spec: str, options: CoreOptions) -> str:
    """Return the text of a new `.core` for `spec`, a specification in the same folder; may raise `InputError`."""
    if fault := text_fault(options.description):
        fail(f"--description {fault[0]}", hint=fault[1])
    further = {"paths": _paths(options.paths), "distro": yaml_scalar(options.distro) if options.distro else ""}
    head = render(
        HEAD_TEMPLATE,
        {
            "name": options.name or f"robot:sys:{system.name}:0.1.0",
            "description": options.description or f"System {system.name}",
            "depend": list(options.depend),
            "spec": spec,
            "options": [{"name": name, "value": value} for name, value in further.items() if value],
            "stimuli": options.stimuli,
            "model": options.model,
            "environment": {"files": _paths(options.environment)} if options.environment else None,
            "bench": {"files": [options.bench, spec, options.stimuli, options.model]} if options.bench else None,
        },
    )
    targets = _targets(system, is_simulated=True, has_environment=bool(options.environment))
    return head + targets + (_bench_targets(system, options.bench) if options.bench else "")


def _bench_targets(system: DerivedSystem, bench: str) -> str:
    """Return the targets of a bench in cocotb, of the simulators that cocotb drives without a C++ compiler."""
    known = {
        name: item for name, item in fitting(has_verilog=_has_verilog(system)).items() if "g++" not in item.programs
    }
    targets = [
        {
            "name": "test_cocotb" if is_first else f"test_cocotb_{name}",
            "title": item.title,
            "module": PurePosixPath(bench).stem,
            "simulator": name,
            "options": _options({**item.system_verilog, **item.options}),
            "translated": None if item.reads_vhdl else {"unit": system.entity},
        }
        for is_first, (name, item) in zip((True, False, False), known.items(), strict=False)
    ]
    return render(BENCH_TEMPLATE, {"targets": targets})


def updated_core(system: DerivedSystem, path: Path) -> str:
    """Return the text of the `.core` at `path` with current targets.

    Raise `InputError` if it is not a system's core.
    """
    core = read_core(path)
    if not isinstance(core.data.get("generate"), dict):
        fail(f"the core {path} has no section 'generate'")
    instances, text = core.section("generate"), path.read_text(encoding="utf-8")
    if _GENERATORS in text and _SYSTEM_CORE not in text:
        fail(
            f"{path} does not depend on '{_SYSTEM_CORE}', which provides the generator 'far'",
            hint=f"{_GENERATORS} provided it earlier",
        )
    if _SYSTEM not in instances:
        fail(
            f"{path} has no instance '{_SYSTEM}' under 'generate'", hint="remove the file, then run this command again"
        )
    is_simulated = _SIMULATION in instances
    has_environment = is_simulated and bool(core.parameters(_SIMULATION).get("environment"))
    targets = _targets(system, is_simulated=is_simulated, has_environment=has_environment)
    if not (section := _SECTION.search(text)):
        return f"{text.rstrip()}\n\n{targets}"
    names = _TARGET.findall(targets)
    own = [target[0].strip("\n") for target in _TARGET.finditer(section[1]) if target[1] not in names]
    rest = text[section.end() :]
    return text[: section.start()] + "\n\n".join([targets.rstrip("\n"), *own]) + "\n" + (f"\n{rest}" if rest else "")


def _targets(system: DerivedSystem, *, is_simulated: bool, has_environment: bool) -> str:
    has_kernels = bool(system.kernels)
    unit = translated_unit(system, has_environment=has_environment)
    return render(
        TARGETS_TEMPLATE,
        {
            "entity": system.entity,
            "simulations": [
                target
                for kind in (_kinds(system) if is_simulated else ())
                for target in _simulations(system, unit, kind)
            ],
            "emulation": _emulation(system, unit) if is_simulated else None,
            # Only an HLS tool generates kernels, so there is no netlist of the whole system.
            "has_kernels": has_kernels,
            "families": [] if has_kernels else FAMILIES,
            "boards": [target for name in boards() if (target := _board(system, name, has_kernels=has_kernels))],
        },
    )


@dataclass(frozen=True)
class _Kind:
    """A kind of simulation: its name, its flag for Verilog simulators, and the suffix of its test bench.

    `product` and `replaced` are further parameters of the generator; `replaced` also applies to the system's generator.
    """

    name: str
    flag: str
    suffix: str
    product: str = ""
    replaced: Mapping[str, str] = field(default_factory=dict)

    @property
    def is_live(self) -> bool:
        """Whether another program starts the simulator."""
        return bool(self.product)


def _kinds(system: DerivedSystem) -> list[_Kind]:
    """Return the kinds of simulations; in the first two, streams replace a node in fabric."""
    streams = {"interconnect": AXI_STREAM} if system.network else {}
    kinds = [
        _Kind("sim", "verilog_host", "tb", replaced=streams),
        _Kind("live", "verilog_pipe", "live", "live", streams),
    ]
    if system.network:
        way = system.network.kind.value
        flag = "verilog_chip" if way in CHIPS else "verilog_phy"
        clock = {"clock": f"{NETWORK_HERTZ[way] / 10**6:g} MHz"}
        kinds.append(_Kind(NETWORK, flag, "network", "network", clock))
    return kinds


def _simulations(system: DerivedSystem, unit: str, kind: _Kind) -> Iterator[dict[str, object]]:
    """Yield the targets of a kind of simulations; the first simulator's target has the name without a suffix.

    For simulators that do not read VHDL, the targets translate the design unit `unit` with all subunits.
    """
    sources = [source.lower() for item in system.accelerator_types for source in item.accelerator.sources]
    is_system_verilog = any(source.endswith((".sv", ".svh")) for source in sources)
    known = fitting(has_verilog=_has_verilog(system), is_live=kind.is_live)
    replaced = ", ".join(f"{name}: {value}" for name, value in kind.replaced.items())
    for name, item in known.items():
        is_first, is_default = item is next(iter(known.values())), name == default_simulator()
        parameters = [f"product: {kind.product}"] * kind.is_live + [f"simulator: {name}"] * (not is_default)
        parameters += [replaced] * bool(replaced)
        # If the default simulator does not support the system, the first target is listed under both names.
        anchor = (kind.name if kind.is_live else name) if is_first and not is_default else ""
        yield {
            "target": kind.name if is_first else f"{kind.name}_{name}",
            "alias": {"name": f"{kind.name}_{name}", "anchor": anchor} if anchor else None,
            "anchored": f" &{anchor}" if anchor else "",
            "description": _description(item, kind, is_first=is_first),
            "replaced": f": {{{replaced}}}" if replaced else "",
            "parameters": f": {{{', '.join(parameters)}}}" if parameters else "",
            "further_flag": "" if item.reads_vhdl else f", {kind.flag}: true",
            "simulator": name,
            "before": _options(item.system_verilog if is_system_verilog else {}),
            "translated": None if item.reads_vhdl else {"unit": unit},
            "options": _options(item.options),
            "toplevel": f"{system.entity}_{kind.suffix}",
        }


def _has_verilog(system: DerivedSystem) -> bool:
    return any(item.own.is_component for item in system.accelerator_types)


def _emulation(system: DerivedSystem, unit: str) -> dict[str, object] | None:
    """Return the target of `firm emulate`, or None for a system that cannot have a serial link."""
    simulator = SIMULATORS[EMULATING]
    has_netlist = not (system.clocks or system.kernels) and system.id_bytes == 1
    if not (has_netlist and may_be_linked(system)):
        return None
    return {
        **EMULATED,
        "simulator": EMULATING,
        "unit": unit,
        "options": _options(simulator.options),
        "toplevel": f"{system.entity}_live",
    }


def _description(simulator: Simulator, kind: _Kind, *, is_first: bool) -> str:
    if kind.name == NETWORK and is_first:
        return f"Build the simulated board of firm live in {simulator.title}, behind the pins of its network"
    if kind.is_live and is_first:
        return f"Build a simulator in {simulator.title} that another program starts and sends frames to"
    if kind.is_live:
        return f"The same in {simulator.title}"
    if is_first:
        netlist = "" if simulator.reads_vhdl else "; GHDL makes a netlist of the VHDL"
        return f"Simulate with {simulator.title}, compare every byte with the model{netlist}"
    return f"The same with {simulator.title}{simulator.remark}"


def _options(options: Mapping[str, str]) -> list[dict[str, str]]:
    return [{"name": name, "value": value} for name, value in options.items()]


def _board(system: DerivedSystem, name: str, *, has_kernels: bool) -> dict[str, object] | None:
    """Return a board's target, or None if the board does not support the system's HLS kernels or network."""
    board = read_board(name)
    if (has_kernels and board.flow != VIVADO) or not _has_network_of(system, board):
        return None
    options: dict[str, str | Sequence[str] | None] = {
        "frontends": ["ghdlsynth"] if board.is_linked else None,
        "part": board.part,
        "board_part": board.board_part,
        # Only if Vivado manages the sources can a block design refer to modules by name.
        "source_mgmt_mode": "All" if board.flow == VIVADO else None,
        "yosys_synth_options": board.synth_options,
        "nextpnr_options": board.nextpnr_options,
        "device": board.device,
        "family" if board.flow == QUARTUS else "device_family": board.device_family,
    }
    top = board_entity(system, board)
    product = "Quartus project" if board.flow == QUARTUS else "Bitstream"
    return {
        "name": name,
        "description": f"{product} for the board {board.description}",
        # Edalize does not have a flow for Quartus.
        "is_tool": board.flow == QUARTUS,
        "flow": str(board.flow),
        "further_flag": board.ddr_flag,
        "options": [{"name": option, "value": _value(value)} for option, value in options.items() if value],
        "toplevel": f"{top}_wrapper" if board.flow == VIVADO else top,
    }


def _has_network_of(system: DerivedSystem, board: Board) -> bool:
    """Return whether a system is the kind of node that a board's interconnect requires."""
    kind = system.network.kind.value if system.network else ""
    return kind in CHIPS if board.interconnect in CHIPS else board.interconnect in (kind, *LINKS, AXI_STREAM)


def _value(value: str | Sequence[str]) -> str:
    """Return a word or a list of words in YAML."""
    return yaml_scalar(str(value)) if isinstance(value, str) else yaml_list(map(str, value))


def _paths(items: Sequence[str | Path]) -> str:
    """Return a list on one line, or an empty string for an empty list."""
    return yaml_list(str(PurePosixPath(item)) for item in items) if items else ""
