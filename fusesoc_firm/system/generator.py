"""The generator `far`: a system's converters, accelerators and top level as a core."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from fusesoc_firm.converter.generator import (
    VHDL,
    constants_files,
    library_sources,
    publisher_files,
    subscriber_files,
)
from fusesoc_firm.converter.payload_length import LENGTH_TEMPLATE, length_entity, payload_length_configuration
from fusesoc_firm.diagnostics import Diagnostics
from fusesoc_firm.generation import GeneratedCore, GeneratedFile, Request
from fusesoc_firm.message.library import MessageLibrary, libraries
from fusesoc_firm.message.model import MessageName, RosVersion
from fusesoc_firm.message.signature import Definitions
from fusesoc_firm.naming import identifier
from fusesoc_firm.render import render
from fusesoc_firm.system.analysis import derive, source_files
from fusesoc_firm.system.configuration import SYSTEM_TEMPLATE, system_configuration
from fusesoc_firm.system.derived import AcceleratorType, DerivedSystem
from fusesoc_firm.system.hls import wrapper_file
from fusesoc_firm.system.specification import Accelerator, Specification, read_specification


@dataclass(frozen=True)
class LoadedSystem:
    """A specification, the folder its paths are relative to, and the system derived from it."""

    specification: Specification
    folder: Path
    libraries: dict[RosVersion, MessageLibrary]
    system: DerivedSystem

    def inputs(self) -> list[Path]:
        """The accelerators' sources and the files of all messages."""
        return source_files(self.specification, self.folder) + self._message_files()

    def messages(self) -> list[tuple[MessageName, Definitions]]:
        """Every message of a converter once, whichever of its fields are used, with all definitions within it."""
        messages = dict.fromkeys((frame.ros, frame.message) for frame in self.system.frames)
        return [(message, self.libraries[ros].closure(message)) for ros, message in messages]

    def _message_files(self) -> list[Path]:
        found: list[Path] = []
        for frame in self.system.frames:
            library = self.libraries[frame.ros]
            found += library.files(library.closure(frame.message))
        return list(dict.fromkeys(found))


def load_system(path: Path, libraries: dict[RosVersion, MessageLibrary]) -> LoadedSystem:
    """Read and derive the system of a specification. Raises `InputError` with all its faults."""
    faults = Diagnostics()
    specification = read_specification(path, str(path), faults)
    system = derive(specification, path.parent, libraries, faults)
    return LoadedSystem(specification, path.parent, libraries, system)


def load_requested(request: Request) -> LoadedSystem:
    """The system of a generator call."""
    return load_system(specification_path(request), libraries(*library_sources(request)))


def specification_path(request: Request) -> Path:
    """The specification that a generator call names."""
    return request.files_root / str(request.parameters["spec"])


def inputs(request: Request) -> list[Path]:
    """The specification and every file that it leads to. Raises `InputError`."""
    return [specification_path(request), *load_requested(request).inputs()]


def generate(request: Request) -> GeneratedCore:
    """The system as a core, its files in the order in which a tool reads them. Raises `InputError`."""
    loaded = load_requested(request)
    system = loaded.system
    files = constants_files(loaded.messages())
    for converter in system.subscribers:
        files |= subscriber_files([converter.frame], system.width, converter.suffix)
    for converter in system.publishers:
        files |= publisher_files([converter.frame], system.width, converter.suffix)
    for frame, suffix in system.computed_lengths.items():
        text = render(LENGTH_TEMPLATE, payload_length_configuration(frame, suffix))
        files[f"{length_entity(frame, suffix)}.vhd"] = GeneratedFile(text, VHDL)
    sources: set[Path] = set()
    for accelerator in system.accelerator_types:
        files |= _accelerator_files(accelerator, system.width, loaded.folder, sources)
    files[f"{system.entity}.vhd"] = GeneratedFile(render(SYSTEM_TEMPLATE, system_configuration(system)), VHDL)
    return GeneratedCore(f"System {system.name}", files)


def _accelerator_files(type_: AcceleratorType, width: int, folder: Path, taken: set[Path]) -> dict[str, GeneratedFile]:
    """The user's VHDL, or the wrapper around the user's C++.

    `taken` are the sources that the core has already: a package of two accelerators must not be analysed twice.
    """
    accelerator = type_.accelerator
    if accelerator.type == "HLS":
        return wrapper_file(type_, width)
    files: dict[str, GeneratedFile] = {}
    for source in accelerator.sources:
        path = (folder / source).resolve()
        if path not in taken:
            files[source_name(accelerator, source)] = GeneratedFile(path.read_bytes(), VHDL)
            taken.add(path)
    return files


def source_name(accelerator: Accelerator, source: str) -> str:
    """Where a source file lies in the generated core: below a folder of its accelerator, as in the specification."""
    names = {"..": "above", "/": "root"}
    parts = [names.get(part, part) for part in PurePosixPath(source).parts]
    return str(PurePosixPath(identifier(accelerator.name), *parts))
