"""The generator `far`: a core with a system's converters, accelerators and top level."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any

from fusesoc_firm.converter.configuration import publisher_entity, subscriber_entity
from fusesoc_firm.converter.converter_core import VHDL, files_of, library_sources
from fusesoc_firm.converter.payload_length import LENGTH_TEMPLATE, length_entity, payload_length_configuration
from fusesoc_firm.converter.pipeline import BORDERS, FULL, NONE, pipeline_of
from fusesoc_firm.converter.sources import Artifact, constants_sources, publisher_source, subscriber_source
from fusesoc_firm.core.request import CoreFolders, GeneratedCore, GeneratedFile, Request, no_core_folders
from fusesoc_firm.message.library import Libraries, MessageLibrary, libraries
from fusesoc_firm.message.middleware import MIDDLEWARES, Definitions, Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.signature import signature
from fusesoc_firm.noc.hardware import TEMPLATE as ROUTERS_TEMPLATE
from fusesoc_firm.noc.hardware import exchange_configuration
from fusesoc_firm.system.boards.block_design import (
    BLOCK_DESIGN_TEMPLATE,
    PACKAGE_TEMPLATE,
    RECORDS_TEMPLATE,
    block_design_configuration,
    package_configuration,
    records_configuration,
    records_entity,
)
from fusesoc_firm.system.boards.board import (
    BOARD_TEMPLATE,
    VIVADO,
    Board,
    board_configuration,
    board_entity,
    board_path,
    check_fits,
    clock_of,
    on_board,
    read_board,
)
from fusesoc_firm.system.boards.pll import PLL_TEMPLATES
from fusesoc_firm.system.boards.timing_constraints import (
    CHECKS_TEMPLATE,
    checks_configuration,
    clocks_configuration,
)
from fusesoc_firm.system.derived.actions import with_actions
from fusesoc_firm.system.derived.cpp_function import function_name
from fusesoc_firm.system.derived.derivation import derive, source_files
from fusesoc_firm.system.derived.ethernet import check_ethernet
from fusesoc_firm.system.derived.model import AcceleratorType, DerivedSystem
from fusesoc_firm.system.derived.services import with_services
from fusesoc_firm.system.hardware.bypass import BYPASS_TEMPLATE, bypass_configuration
from fusesoc_firm.system.hardware.compiled import compiled, compiler_files
from fusesoc_firm.system.hardware.configuration import SYSTEM_TEMPLATE, system_configuration
from fusesoc_firm.system.hardware.exchange import (
    EXCHANGE_TEMPLATE,
    exchange_entity,
    exchange_unit,
    routers_entity,
)
from fusesoc_firm.system.hardware.hls import wrapper
from fusesoc_firm.system.hardware.registers import RegisterMap, register_map, registers_configuration
from fusesoc_firm.system.hardware.status import (
    REGISTERS_TEMPLATE,
    Identity,
    address_bits,
    features_of,
    identity_of,
    status_description,
    status_entity,
)
from fusesoc_firm.system.written.specification import (
    Accelerator,
    Draft,
    Specification,
    is_core,
    read_specification,
)
from fusesoc_firm.text.diagnostics import Diagnostic, Diagnostics, InputError, SourceRef, fail, nearest_file
from fusesoc_firm.text.naming import identifier
from fusesoc_firm.text.render import render
from fusesoc_firm.text.yaml_text import Text
from fusesoc_firm.tools.flows import Flow
from fusesoc_firm.tools.open_flows import OPEN_FLOWS
from fusesoc_firm.tools.reads import Input

# FuseSoC's file types of Verilog by suffix, and the suffixes of files that are not compiled separately.
_FILE_TYPES = {
    ".v": "verilogSource-2005",
    ".vh": "verilogSource-2005",
    ".sv": "systemVerilogSource",
    ".svh": "systemVerilogSource",
}
# Parameters of a call that replace keys of the project.
_REPLACING = ("interconnect", "clock")
# The languages whose sources are hardware.
_WRITTEN = ("VHDL", "Verilog")
_INCLUDE_SUFFIXES = (".vh", ".svh")
# In Hz. Without register slices, a system that passes through messages of variable size reaches 99 MHz on an ECP5.
_SLICED_ABOVE = 100 * 10**6
_BYTE_BITS = 8


@dataclass(frozen=True)
class LoadedSystem:
    """A specification, its folder, an optional board, and the derived system; paths are relative to the folder.

    `warnings` are for the author of the specification.
    """

    specification: Specification
    folder: Path
    libraries: Mapping[Middleware, MessageLibrary]
    system: DerivedSystem
    board: Board | None = None
    warnings: tuple[Diagnostic, ...] = ()

    def inputs(self) -> list[Input]:
        """Return the accelerators' sources and the definitions of all messages."""
        has_compiled = any(item.is_compiled for item in self.specification.accelerators)
        tables = compiler_files() if has_compiled else []
        return [*source_files(self.specification, self.folder), *tables, *self._message_files()]

    def messages(self) -> list[tuple[MessageName, Definitions]]:
        """Return each message of the converters once, with its definition and all nested definitions."""
        messages = dict.fromkeys((frame.ros, frame.message) for frame in self.system.frames)
        return [(message, self.libraries[ros].closure(message)) for ros, message in messages]

    def definitions(self) -> list[tuple[MessageLibrary, Definitions]]:
        """Return each message's library, definition and nested definitions, including the messages of software."""
        types = self.system.software.types
        sides = [side.frame for type_ in types for side in (*type_.inputs, *type_.outputs)]
        frames = dict.fromkeys((*self.system.frames, *sides))
        return [(self.libraries[frame.ros], self.libraries[frame.ros].closure(frame.message)) for frame in frames]

    def _message_files(self) -> list[Input]:
        found = [path for library, definitions in self.definitions() for path in library.files(definitions)]
        return list(dict.fromkeys(found))


def _unchanged(specification: Specification) -> Specification:
    return specification


def load_system(
    source: Path | Draft,
    libraries: Mapping[Middleware, MessageLibrary],
    *,
    needs_sources: bool = True,
    changed: Callable[[Specification], Specification] = _unchanged,
    core_folders: CoreFolders = no_core_folders,
) -> LoadedSystem:
    """Read a specification and derive its system; raise `InputError` with all faults.

    `changed` adapts the specification, such as to a board. Missing source files of accelerators are an error only if
    `needs_sources` is set. Messages in the `paths` of the specification take precedence over messages in `libraries`.
    """
    faults = Diagnostics()
    path = source.path if isinstance(source, Draft) else source
    specification = changed(read_specification(source, str(path), faults))
    own = {str(item): item.source for item in specification.paths}
    spoken = {MIDDLEWARES[word] for word in specification.middlewares if word in MIDDLEWARES} or {*libraries}
    needed = Libraries({ros: partial(libraries.__getitem__, ros) for ros in libraries if ros in spoken})
    libraries = with_paths(needed, own, path.parent, core_folders, faults)
    specification = with_services(specification, libraries, faults)
    specification = with_actions(specification, libraries, faults)
    system = derive(specification, path.parent, libraries, faults, needs_sources=needs_sources)
    check_ethernet(specification, system, faults)
    faults.raise_if_any()
    return LoadedSystem(specification, path.parent, libraries, system, None, faults.warnings)


def with_paths(
    known: Mapping[Middleware, MessageLibrary],
    paths: Mapping[str, SourceRef | None],
    folder: Path,
    core_folders: CoreFolders,
    faults: Diagnostics,
) -> dict[Middleware, MessageLibrary]:
    """Return the libraries, in which the `paths` of a specification in `folder` take precedence.

    Raise `InputError` with all `faults` if one of these paths is wrong, since a wrong path leads to unknown messages.
    """
    before = len(faults.found)
    places: dict[Path, SourceRef | None] = {}
    for item, source in paths.items():
        try:
            places |= dict.fromkeys(core_folders({item: source}) if is_core(item) else [folder / item], source)
        except InputError as error:
            faults.take(error, source)
    own: dict[Middleware, MessageLibrary] = {}
    for ros in known:
        try:
            own[ros] = known[ros].before(places)
        except InputError as error:
            faults.take(error, None)
    if len(faults.found) > before:
        faults.raise_if_any()
    return own


def load_requested(request: Request) -> LoadedSystem:
    """Return the system of a generator call."""
    board = _board(request)
    given = {name: str(value) for name in _REPLACING if (value := request.parameters.get(name))}
    path = specification_path(request)
    if not path.is_file():
        fail(f"there is no specification {path}", request.place("spec"), nearest_file(path))
    loaded = load_system(
        path,
        libraries(*library_sources(request)),
        changed=lambda written: with_keys(on_board(written, board) if board else written, given),
        core_folders=request.message_folders.of,
    )
    if board and board.is_linked and loaded.system.clock != clock_of(board):
        message = f"clk of board '{board.name}' has {board.clock}, not {given['clock']}"
        fail(message, request.place("clock"), "remove the parameter 'clock'; a pin or a PLL of the board sets it")
    return replace(loaded, board=board)


def with_keys(specification: Specification, values: Mapping[str, str]) -> Specification:
    """Return the specification with other values of some of the project's keys."""
    texts: dict[str, Any] = {name: Text(value) for name, value in values.items()}
    return replace(specification, project=replace(specification.project, **texts))


def specification_path(request: Request) -> Path:
    """Return the path of the specification that a generator call names."""
    return request.files_root / str(request.parameters["spec"])


def inputs(request: Request, loaded: LoadedSystem) -> list[Input]:
    """Return the specification of a request, and all files that the specification uses."""
    board = [_board_path(request)] if request.parameters.get("board") else []
    return [specification_path(request), *board, *loaded.inputs()]


def _board_path(request: Request) -> Path:
    return board_path(str(request.parameters["board"]), request.files_root)


def _board(request: Request) -> Board | None:
    name = request.parameters.get("board")
    return read_board(str(name), request.files_root) if name else None


def artifacts(loaded: LoadedSystem) -> list[Artifact]:
    """Return all generated files of a system, each once, in compilation order with the top level last."""
    return list({item.path: item for item in _artifacts(loaded)}.values())


def _least_pipeline(system: DerivedSystem) -> str:
    """Return the register stages that the frequency of clk needs.

    A window of several bytes has a shifter, so its paths to the fields' registers are longer than at 8 bits.
    """
    if system.clock is None or system.clock <= _SLICED_ABOVE:
        return NONE
    return BORDERS if system.width == _BYTE_BITS else FULL


def _artifacts(loaded: LoadedSystem) -> Iterator[Artifact]:
    system = loaded.system
    yield from constants_sources(loaded.messages())
    for item in system.subscribers:
        pipeline = pipeline_of(item.frame, system.pipeline, _least_pipeline(system))
        yield subscriber_source(item.frame, system.width, subscriber_entity(item.frame, item.suffix), pipeline)
    for item in system.publishers:
        yield publisher_source(item.frame, system.width, publisher_entity(item.frame, item.suffix))
    for frame, suffix in system.computed_lengths.items():
        configuration = payload_length_configuration(frame, suffix)
        yield Artifact(f"{length_entity(frame, suffix)}.vhd", LENGTH_TEMPLATE, configuration)
    for type_ in system.kernels:
        made = wrapper(type_)
        yield Artifact(f"{type_.entity}.vhd", made.template, dict(made.context))
    for own in dict.fromkeys(item.own for item in system.accelerator_types if item.accelerator.is_compiled):
        made = compiled(own, loaded.folder)
        yield Artifact(f"{own.entity}.vhd", made.template, dict(made.context))
    for type_ in system.accelerator_types:
        if type_.inner:
            yield Artifact(f"{type_.entity}.vhd", BYPASS_TEMPLATE, bypass_configuration(type_))
    if system.status:
        signatures = identity(loaded).signatures
        configuration = registers_configuration(status_registers(loaded), signatures, address_bits(system))
        yield Artifact(f"{status_entity(system)}.vhd", REGISTERS_TEMPLATE, configuration)
    if system.exchange:
        routers = routers_entity(system)
        configuration = exchange_configuration(routers, system.exchange.network, system.width)
        yield Artifact(f"{routers}.vhd", ROUTERS_TEMPLATE, configuration)
        yield Artifact(f"{exchange_entity(system)}.vhd", EXCHANGE_TEMPLATE, exchange_unit(system))
    yield Artifact(f"{system.entity}.vhd", SYSTEM_TEMPLATE, system_configuration(system))


def identity(loaded: LoadedSystem) -> Identity:
    """Return the identity of a system's hardware."""
    system = loaded.system
    messages = [(item.frame.ros, item.frame.message) for item in (*system.subscribers, *system.publishers)]
    return identity_of(system, [signature(name, loaded.libraries[ros].closure(name)) for ros, name in messages])


def status_registers(loaded: LoadedSystem) -> RegisterMap:
    """Return the registers of a system's status."""
    return register_map(status_text(loaded))


def status_text(loaded: LoadedSystem) -> str:
    """Return the description of a system's status in SystemRDL."""
    system = loaded.system
    shape = len(system.subscribers), len(system.publishers)
    digest = identity(loaded).digest
    return status_description(system.name, shape, digest, features_of(system), system.parameters)


def system_core(loaded: LoadedSystem) -> GeneratedCore:
    """Return the core of a loaded system, with its files in compilation order; may raise `InputError`."""
    system = loaded.system
    made = files_of(artifacts(loaded))
    # Units that instantiate the user's units follow them.
    after = [*(f"{type_.entity}.vhd" for type_ in system.accelerator_types if type_.inner), f"{system.entity}.vhd"]
    files = {path: file for path, file in made.items() if path not in after}
    files |= _sources(system.accelerator_types, loaded.folder)
    files |= {path: made[path] for path in after}
    if loaded.board:
        files |= flow_file(loaded.board.edalize_flow) | _board_files(loaded, loaded.board)
    return GeneratedCore(f"System {system.name}", files)


def flow_file(flow: Flow) -> dict[str, GeneratedFile]:
    """Return the file with the flow of a target that uses the generated core."""
    return {flow.file_name(): GeneratedFile(flow.text(), "user")}


def _board_files(loaded: LoadedSystem, board: Board) -> dict[str, GeneratedFile]:
    """Return the top level and the constraints that fit a system to a board."""
    check_fits(loaded.system, board)
    if board.is_linked:
        return _linked_files(loaded, board)
    return _processor_files(loaded, board) if board.flow == VIVADO else _clock_files(loaded, board, "sdc", "SDC", "|")


def _linked_files(loaded: LoadedSystem, board: Board) -> dict[str, GeneratedFile]:
    configuration = board_configuration(loaded.system, board)
    flow = OPEN_FLOWS[board.flow]
    files = {}
    if pll := configuration["pll"]:
        files[f"{pll['entity']}.v"] = GeneratedFile(render(PLL_TEMPLATES[board.flow], pll), _FILE_TYPES[".v"])
    return files | {
        f"{configuration['entity']}.vhd": GeneratedFile(render(BOARD_TEMPLATE, configuration), VHDL),
        f"{board.name}.{flow.constraints}": GeneratedFile(
            render(f"board/{flow.constraints}", configuration), flow.file_type
        ),
    }


def _processor_files(loaded: LoadedSystem, board: Board) -> dict[str, GeneratedFile]:
    """Return the block design, and the scripts that turn C++ functions into IPs."""
    system, clock = loaded.system, _clock(loaded)
    files: dict[str, GeneratedFile] = {}
    for type_ in system.kernels:
        paths = {source_name(type_.accelerator, source): loaded.folder / source for source in type_.accelerator.sources}
        files |= {name: GeneratedFile(path.read_bytes(), "user") for name, path in paths.items()}
        script = render(PACKAGE_TEMPLATE, package_configuration(type_, list(paths), system, board, clock))
        files[f"{function_name(type_)}.tcl"] = GeneratedFile(script, "user")
    files |= _clock_files(loaded, board, "xdc", "xdc", "/")
    checks = render(CHECKS_TEMPLATE, checks_configuration(system, board, clock))
    files[f"{board.name}_checks.tcl"] = GeneratedFile(checks, "user")
    records = render(RECORDS_TEMPLATE, records_configuration(system))
    files[f"{records_entity(system)}.vhd"] = GeneratedFile(records, VHDL)
    design = render(BLOCK_DESIGN_TEMPLATE, block_design_configuration(system, board, clock))
    files[f"{board_entity(system, board)}.tcl"] = GeneratedFile(design, "tclSource")
    return files


def _clock_files(
    loaded: LoadedSystem, board: Board, form: str, file_type: str, separator: str
) -> dict[str, GeneratedFile]:
    """Return the timing constraints of clocks."""
    text = render(f"board/{form}", clocks_configuration(loaded.system, board, _clock(loaded), separator))
    return {f"{board.name}.{form}": GeneratedFile(text, file_type)}


def _clock(loaded: LoadedSystem) -> Fraction:
    """Return the frequency of clk in Hz."""
    assert loaded.system.clock is not None, "a board has a clock"
    return loaded.system.clock


def _sources(types: Iterable[AcceleratorType], folder: Path) -> dict[str, GeneratedFile]:
    """Return the user's VHDL and Verilog files, each once, since tools must not analyse a shared package twice."""
    files: dict[str, GeneratedFile] = {}
    taken: set[Path] = set()
    for type_ in types:
        accelerator = type_.accelerator
        for source in accelerator.sources if accelerator.type in _WRITTEN else ():
            path = (folder / source).resolve()
            if path not in taken:
                suffix = path.suffix.lower()
                files[source_name(accelerator, source)] = GeneratedFile(
                    path.read_bytes(), _file_type(accelerator, suffix), is_include_file=suffix in _INCLUDE_SUFFIXES
                )
                taken.add(path)
    return files


def _file_type(accelerator: Accelerator, suffix: str) -> str:
    return f"vhdlSource-{accelerator.vhdl_standard}" if accelerator.type == "VHDL" else _FILE_TYPES[suffix]


def source_name(accelerator: Accelerator, source: str) -> str:
    """Return the path of a source in the generated core: the accelerator's folder, then the specification's path."""
    names = {"..": "above", "/": "root"}
    parts = [names.get(part, part) for part in PurePosixPath(source).parts]
    return str(PurePosixPath(identifier(accelerator.name), *parts))
