"""The `.core` file of a system, with all targets that the system supports.

The upper part of the file is generated once; after that, the author maintains it. The targets are regenerated from a
template, so that existing systems also receive new targets. Targets that the author added under other names are kept.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from fusesoc_firm.core.core_reader import read_core
from fusesoc_firm.system.boards.board import VIVADO, board_entity, boards, read_board
from fusesoc_firm.system.derived.link import may_be_linked
from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.system.scaffold.board_targets import has_target
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.system.written.specification import AXI_STREAM, CHIPS, ETHERNET
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.naming import text_fault
from fusesoc_firm.text.quoting import yaml_list
from fusesoc_firm.text.render import render
from fusesoc_firm.tools.flows import FAMILIES, simulator_flow
from fusesoc_firm.tools.simulators import default_simulator, fitting

HEAD_TEMPLATE = "core/system.core"
TARGETS_TEMPLATE = "core/targets.core"
BENCH_TEMPLATE = "core/cocotb.core"

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
# The longest line of a target, unless one word is longer.
_COLUMNS = 118
_SECTION = re.compile(r"^targets:[^\n]*\n((?:[ \t#][^\n]*\n|\n)*)", re.MULTILINE)
# A target with the comment above it; blank lines separate targets.
_TARGET = re.compile(r"^(?:  #[^\n]*\n)*  (\S+):[^\n]*\n(?:(?: {3,}[^\n]*| *)\n)*", re.MULTILINE)
# The anchor of a target; those of the product's kinds are defined by the first target of a kind.
_ANCHOR = re.compile(r"^(  \S+:) &(?:sim|live|network|emulate|synth|board)(?= )", re.MULTILINE)

MODEL = "model.py"
"""The usual file of a model."""
# On what a system with accelerators in Python depends.
_PYTHON = "robot:acc:firm_python"


@dataclass(frozen=True)
class CoreOptions:
    """The options of a new `.core` that the specification does not determine; paths are relative to the core.

    Without a `model`, the functions of accelerators in Python are the model. `bench` is the name of a bench in cocotb,
    which reads specification, stimuli and model.
    """

    name: str = ""
    description: str = ""
    depend: Sequence[str] = ()
    stimuli: str = "stimuli.yaml"
    model: str = MODEL
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
    is_model = loaded.system.is_compiled and options.model == MODEL and not (folder / MODEL).exists()
    has_compiled = any(item.type.own.accelerator.is_compiled for item in loaded.system.accelerators)
    own = [_PYTHON] if has_compiled and not any(item.startswith(_PYTHON) for item in options.depend) else []
    options = replace(
        options,
        depend=[*options.depend, *own, *loaded.specification.message_cores],
        # The functions are the model.
        model="" if is_model else options.model,
        paths=[os.path.relpath(item, folder) for item in options.paths],
    )
    return new_core(loaded.system, os.path.relpath(spec, folder), options)


def new_core(system: DerivedSystem, spec: str, options: CoreOptions) -> str:
    """Return the text of a new `.core` for `spec`, a specification in the same folder; may raise `InputError`."""
    if fault := text_fault(options.description):
        fail(f"--description {fault[0]}", hint=fault[1])
    common = {"spec": spec, "paths": _paths(options.paths), "distro": options.distro}
    simulation = {
        "product": "simulation",
        "stimuli": options.stimuli,
        **({"model": options.model} if options.model else {}),
        "environment": _paths(options.environment),
    }
    head = render(
        HEAD_TEMPLATE,
        {
            "name": options.name or f"robot:sys:{system.name}:0.1.0",
            "description": options.description or f"System {system.name}",
            "depend": list(options.depend),
            "system": f"{{{_mapping(common)}}}",
            "simulation": _mapping(simulation),
            "bench": {"files": [options.bench, spec, options.stimuli, options.model]} if options.bench else None,
        },
    )
    targets = _targets(system, is_simulated=True)
    return head + targets + (_bench_targets(system, options.bench) if options.bench else "")


def _bench_targets(system: DerivedSystem, bench: str) -> str:
    """Return the targets of a bench in cocotb."""
    known = {name: item for name, item in fitting(has_verilog=_has_verilog(system)).items() if item.runs_cocotb}
    module = PurePosixPath(bench).stem
    flows = {name: simulator_flow(name, system.entity, is_system_verilog=True) for name in known}
    targets = [
        {
            "name": "test_cocotb" if is_first else f"test_cocotb_{name}",
            "title": item.title,
            "module": module,
            "options": f"{{{_mapping({'cocotb_module': module, **flows[name].options})}}}",
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
    targets = _targets(system, is_simulated=_SIMULATION in instances)
    if not (section := _SECTION.search(text)):
        return f"{text.rstrip()}\n\n{targets}"
    names = _TARGET.findall(targets)
    # A target that the product wrote earlier, such as of a board that no longer fits, may have an anchor of these.
    own = [_ANCHOR.sub(r"\1", item[0].strip("\n")) for item in _TARGET.finditer(section[1]) if item[1] not in names]
    rest = text[section.end() :]
    return text[: section.start()] + "\n\n".join([targets.rstrip("\n"), *own]) + "\n" + (f"\n{rest}" if rest else "")


def toplevels(system: DerivedSystem) -> dict[str, str]:
    """Return the top level of each target that the core of a system may have."""
    kinds = _kinds(system, is_simulated=True)
    return {"default": system.entity} | {target.name: target.toplevel for kind in kinds for target in kind.targets}


def _kinds(system: DerivedSystem, *, is_simulated: bool) -> list[_Kind]:
    return [*(_simulations(system) if is_simulated else ()), *_reports(system), _boards(system)]


def _targets(system: DerivedSystem, *, is_simulated: bool) -> str:
    has_kernels = bool(system.kernels)
    kinds = _kinds(system, is_simulated=is_simulated)
    return render(
        TARGETS_TEMPLATE,
        {
            "entity": system.entity,
            "kinds": [kind.context() for kind in kinds if kind.targets],
            # Only an HLS tool generates kernels, so there is no netlist of the whole system.
            "has_kernels": has_kernels,
        },
    )


@dataclass(frozen=True)
class _Target:
    """A target: the words that set it apart from the others of its kind, its top level, and a flag for the simulation.

    Words are entries of a mapping in YAML, or parts of one at whose commas the line may end.
    """

    name: str
    words: Sequence[str]
    toplevel: str
    flag: str = ""

    @property
    def flags(self) -> str:
        """The entry with the flags."""
        return f"flags: {{{', '.join(f'{name}: true' for name in ('firm_launcher', self.flag) if name)}}}"


@dataclass(frozen=True)
class _Kind:
    """Targets that inherit from the first one; `alias` is a further name of the first target."""

    name: str
    description: str
    targets: Sequence[_Target]
    alias: str = ""

    def context(self) -> dict[str, object]:
        """Return the data for the template."""
        first, *others = self.targets
        texts = [_wrapped(f"{first.name}: &{self.name}", self._words_of(first))]
        texts += [_wrapped(f"{target.name}:", self._changed(target, first)) for target in others]
        return {"kind": self.name, "targets": texts, "alias": self.alias}

    def _words_of(self, target: _Target) -> list[str]:
        begin = ["<<: *default", "flow: firm", target.flags]
        return [*begin, *target.words, f"toplevel: {target.toplevel}", f'description: "{self.description}"']

    def _changed(self, target: _Target, first: _Target) -> list[str]:
        flags = [target.flags] if target.flags != first.flags else []
        toplevel = [f"toplevel: {target.toplevel}"] if target.toplevel != first.toplevel else []
        return [f"<<: *{self.name}", *flags, *target.words, *toplevel]


def _wrapped(begin: str, words: Sequence[str]) -> str:
    """Return a target as a mapping in YAML, on few lines; none starts with the end of a word."""
    text, line = "", f"  {begin} {{{words[0]}"
    for word in words[1:]:
        if len(line) + len(word) + 3 > _COLUMNS:
            text, line = f"{text}{line},\n", f"    {word}"
        else:
            line += f", {word}"
    return f"{text}{line}}}".removeprefix("  ")


def _simulations(system: DerivedSystem) -> Iterator[_Kind]:
    """Yield the kinds of simulations; in the first two, streams replace a node in fabric."""
    streams = {"interconnect": AXI_STREAM} if system.network else {}
    yield _simulation(system, "sim", "Simulate, and compare every byte with the model", "verilog_host", streams)
    text = "Build a simulator that another program starts and sends frames to"
    yield _simulation(system, "live", text, "verilog_pipe", streams)
    if system.network:
        way = system.network.kind.value
        flag = "verilog_chip" if way in CHIPS else "verilog_phy"
        clock = {"clock": f"{NETWORK_HERTZ[way] / 10**6:g} MHz"}
        text = "Build the simulated board of firm live, behind the pins of its network"
        yield _simulation(system, NETWORK, text, flag, clock)
    yield _emulation(system)


def _simulation(system: DerivedSystem, kind: str, description: str, flag: str, replaced: Mapping[str, str]) -> _Kind:
    """Return a kind of simulation; the first simulator's target has the name of the kind.

    `replaced` are parameters of both generators, and `flag` selects the simulated host in Verilog. Each kind but `sim`
    is a product of the generator, whose simulator another program starts.
    """
    is_live = kind != "sim"
    known, default = fitting(has_verilog=_has_verilog(system), is_live=is_live), default_simulator()
    targets: list[_Target] = []
    for name, simulator in known.items():
        parameters = {"product": kind} if is_live else {}
        parameters |= {"simulator": name} if name != default else {}
        words = _generate(_call(_SYSTEM, replaced), _call(_SIMULATION, {**parameters, **replaced}))
        toplevel = f"{system.entity}_{kind if is_live else 'tb'}"
        own = flag.replace("verilog", "vhdl") if simulator.reads_vhdl else flag
        # A target with the name of its kind needs no flag for the host in VHDL.
        own = "" if simulator.reads_vhdl and not targets else own
        targets.append(_Target(f"{kind}_{name}" if targets else kind, words, toplevel, own))
    first = next(iter(known))
    return _Kind(kind, description, targets, "" if first == default else f"{kind}_{first}")


def _generate(*calls: str) -> list[str]:
    """Return the entry that lists the uses of generators, in parts if it is longer than a line."""
    whole = f"generate: [{', '.join(calls)}]"
    if len(whole) < _COLUMNS - 4:
        return [whole]
    return [f"{'generate: [' * (call is calls[0])}{call}{']' * (call is calls[-1])}" for call in calls]


def _call(instance: str, parameters: Mapping[str, str]) -> str:
    """Return the use of a generator's instance with replaced parameters."""
    listed = ", ".join(f"{name}: {value}" for name, value in parameters.items())
    return f"{instance}: {{{listed}}}" if listed else instance


def _emulation(system: DerivedSystem) -> _Kind:
    """Return the target of `firm emulate`, which a system that cannot have a serial link does not have."""
    has_netlist = not system.kernels and system.id_bytes == 1
    simulation = _call(_SIMULATION, {"product": "live", "simulator": EMULATING, **EMULATED})
    words = _generate(_call(_SYSTEM, EMULATED), simulation)
    target = _Target("emulate", words, f"{system.entity}_live", "verilog_pipe")
    text = "Build the hardware of firm emulate, behind the pins of a UART"
    return _Kind("emulate", text, [target] if has_netlist and may_be_linked(system) else [])


def _reports(system: DerivedSystem) -> Iterator[_Kind]:
    """Yield the targets that count cells; kernels have no netlist before an HLS tool has generated them."""
    if not system.kernels:
        targets = [_Target(f"synth_{name}", [f"flow_options: {{family: {name}}}"], system.entity) for name in FAMILIES]
        yield _Kind("synth", "Count the cells that Yosys makes for a family of FPGAs", targets)


def _boards(system: DerivedSystem) -> _Kind:
    """Return the targets of the boards that support the system's HLS kernels or network."""
    known = {name: read_board(name) for name in boards()}
    targets = [
        _Target(
            name,
            _generate(_call(_SYSTEM, {"board": name})),
            f"{board_entity(system, board)}{'_wrapper' * (board.flow == VIVADO)}",
            board.ddr_flag or "",
        )
        for name, board in known.items()
        if has_target(system, board)
    ]
    # The others inherit from the first one, whose flags should be the common ones.
    targets.sort(key=lambda target: target.flag)
    return _Kind("board", "Build the bitstream, or a vendor's project, for the board of this name", targets)


def _has_verilog(system: DerivedSystem) -> bool:
    return any(item.own.is_component for item in system.accelerator_types)


def _mapping(values: Mapping[str, str | Sequence[str]]) -> str:
    """Return the entries of a mapping in YAML on one line, without those that are empty."""
    # In a mapping on one line, a comma ends a word, as in a list.
    texts = {
        name: yaml_list([value])[1:-1] if isinstance(value, str) else yaml_list(value)
        for name, value in values.items()
        if value
    }
    return ", ".join(f"{name}: {text}" for name, text in texts.items())


def _paths(items: Sequence[str | Path]) -> list[str]:
    return [str(PurePosixPath(item)) for item in items]
