"""The data between FuseSoC's generator call and the stages, which convert a request to a generated core.

This module is independent of the stages, so `converter` and `system` can return the values that `plugin` writes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusesoc_firm.text.diagnostics import SourceRef, fail
from fusesoc_firm.text.yaml_text import yaml_dump
from fusesoc_firm.tools.reads import Input

if TYPE_CHECKING:
    from fusesoc_firm.message.library import MessageLibrary
    from fusesoc_firm.message.middleware import Definitions

_LONGEST_FILE_NAME = 255
Plain = str | int | bool | list[str] | None
"""A value of a generator's parameter; None means that the parameter is not given and has no default."""
CoreFolders = Callable[[Mapping[str, SourceRef | None]], Sequence[Path]]
"""A function that finds the folders of message cores, given by name and place; it may raise `InputError`."""


def no_core_folders(names: Mapping[str, SourceRef | None]) -> Sequence[Path]:
    """Raise `InputError` for every core, since message cores cannot be looked up."""
    for name, source in names.items():
        fail(
            f"message cores such as '{name}' cannot be looked up here",
            source,
            "give the folder with the message definitions",
        )
    return ()


@dataclass(frozen=True)
class GeneratorCall:
    """FuseSoC's call of a generator: the new core's name, the requesting core's folder, and the parameters."""

    generator: str
    vlnv: str
    files_root: str
    parameters: Mapping[str, Any]


class MessageFolders:
    """The folders of the message cores in use; `find` is called once per core, and `found` caches the results."""

    def __init__(self, find: CoreFolders = no_core_folders) -> None:
        self.found: dict[str, Sequence[Path]] = {}
        self._find = find

    def of(self, cores: Mapping[str, SourceRef | None]) -> list[Path]:
        """Return the folders of cores, given with their places. Raise `InputError` for an unknown core."""
        for name, source in cores.items():
            if name not in self.found:
                self.found[name] = self._find({name: source})
        return [folder for name in cores for folder in self.found[name]]


@dataclass(frozen=True)
class Request:
    """A generator call with checked parameters, from the core in the folder `files_root`, for the new core `vlnv`.

    `places` contains the places of values, or of the items of lists, if known; they are not part of the key.
    `message_folders` finds the folders of the message cores in the request or its specification.
    """

    command: str
    vlnv: str
    files_root: Path
    parameters: Mapping[str, Plain]
    places: Mapping[str, Sequence[SourceRef]] = field(default_factory=dict, compare=False)
    message_folders: MessageFolders = field(default_factory=MessageFolders, compare=False)

    @property
    def name(self) -> str:
        """The new core's name, `<requesting core>-<instance>`."""
        return self.vlnv.split(":")[2]

    def listed(self, parameter: str) -> dict[str, SourceRef | None]:
        """Return the items of a list parameter, each with its place; without the parameter, an empty dictionary."""
        items = self.parameters.get(parameter) or []
        assert isinstance(items, list)
        places = self.places.get(parameter, ())
        return dict(zip(items, places if len(places) == len(items) else [None] * len(items), strict=True))

    def place(self, parameter: str) -> SourceRef | None:
        """Return the place of a parameter's value, or None if it is unknown."""
        return next(iter(self.places.get(parameter, ())), None)

    def definition_folders(self) -> list[Path]:
        """Return the folders in `paths`, then those of the cores in `messages`. May raise `InputError`."""
        paths = (self.files_root / path for path in self.listed("paths"))
        return [*paths, *self.message_folders.of(self.listed("messages"))]


@dataclass(frozen=True)
class GeneratedFile:
    """A file of a generated core.

    `file_type` is FuseSoC's name for the type (`vhdlSource-93`, `user`, ...), `logical_name` is the VHDL library, and
    `copyto` is the file's place in the tool's work folder; an empty value omits the attribute. `is_include_file` marks
    a file that other files include.
    """

    content: str | bytes
    file_type: str
    logical_name: str = ""
    copyto: str = ""
    tags: tuple[str, ...] = ()
    is_include_file: bool = False


@dataclass(frozen=True)
class GeneratedCore:
    """The core that a generator returns: its files by relative path, in the order in which tools read them."""

    description: str
    files: Mapping[str, GeneratedFile] = field(default_factory=dict)


@dataclass(frozen=True)
class LoadedRequest:
    """A request with its inputs and derived data, which are computed only once.

    `inputs` are the files that determine the core; a path need not exist. `generate` creates the core;
    `definitions` returns the library of each message with all nested definitions. Both may raise `InputError`.
    """

    request: Request
    inputs: Sequence[Input]
    generate: Callable[[], GeneratedCore]
    definitions: Callable[[], Sequence[tuple[MessageLibrary, Definitions]]]


def as_files(core: GeneratedCore, request: Request) -> dict[str, bytes]:
    """Return the files to write for FuseSoC, by path; the `.core` file is last, so that it completes the core.

    Raise `InputError` for a name that is too long for a file.
    """
    contents = {_checked(path): _encoded(file.content) for path, file in core.files.items()}
    return contents | {f"{request.name}.core": core_text(core, request.vlnv).encode()}


def _checked(path: str) -> str:
    """Return `path`.

    Raise `InputError` if a part exceeds the file systems' limit, since entities combine several names.
    """
    for part in path.split("/"):
        if (size := len(part.encode())) > _LONGEST_FILE_NAME:
            fail(f"the name of the file '{part[:40]}...' would have {size} bytes; legal: at most {_LONGEST_FILE_NAME}")
    return path


def core_text(core: GeneratedCore, vlnv: str) -> str:
    """Return the text of the `.core` file, which depends only on the core and its name."""
    description = {
        "name": vlnv,
        "description": core.description,
        "filesets": {"generated": {"files": [{path: _attributes(file)} for path, file in core.files.items()]}},
        "targets": {"default": {"filesets": ["generated"]}},
    }
    return "CAPI=2:\n" + yaml_dump(description)


def _attributes(file: GeneratedFile) -> dict[str, object]:
    attributes = {
        "file_type": file.file_type,
        "logical_name": file.logical_name,
        "copyto": file.copyto,
        "tags": list(file.tags),
        "is_include_file": file.is_include_file,
    }
    return {name: value for name, value in attributes.items() if value}


def _encoded(content: str | bytes) -> bytes:
    return content.encode() if isinstance(content, str) else content
