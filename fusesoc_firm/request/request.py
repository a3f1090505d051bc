"""What passes between FuseSoC's generator call and the stages that answer it: a request in, a generated core out.

It knows no stage, so `converter` and `system` can return what `plugin` writes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.model import Definitions
from fusesoc_firm.store.reads import Input
from fusesoc_firm.text.diagnostics import SourceRef, fail
from fusesoc_firm.text.yaml_text import yaml_dump

_LONGEST_FILE_NAME = 255
Plain = str | int | bool | list[str] | None
"""What a generator's parameter can be; None is one that was not given and has no default."""
CoreFolders = Callable[[Mapping[str, SourceRef | None]], Sequence[Path]]
"""Finds the folders of the messages of cores, given by name and place. Raises `InputError` for an unknown one."""


def no_core_folders(names: Mapping[str, SourceRef | None]) -> Sequence[Path]:
    """Where no core can be looked up."""
    for name, source in names.items():
        fail(f"core '{name}' cannot be looked up here", source, "name the folder of its messages")
    return ()


@dataclass(frozen=True)
class GeneratorCall:
    """A call of a generator as FuseSoC makes it: the new core's name, the requesting core's folder, parameters."""

    generator: str
    vlnv: str
    files_root: str
    parameters: Mapping[str, Any]


class MessageFolders:
    """The folders of the cores whose messages are used; `find` is asked for each core once, and `found` has them."""

    def __init__(self, find: CoreFolders = no_core_folders) -> None:
        self.found: dict[str, Sequence[Path]] = {}
        self._find = find

    def of(self, cores: Mapping[str, SourceRef | None]) -> list[Path]:
        """The folders of some cores, each with its place. Raises `InputError` for an unknown one."""
        for name, source in cores.items():
            if name not in self.found:
                self.found[name] = self._find({name: source})
        return [folder for name in cores for folder in self.found[name]]


@dataclass(frozen=True)
class Request:
    """A generator call with checked parameters; `files_root` is the requesting core's folder, `vlnv` the new core's.

    `places` tells where the items of a list parameter are, as far as that is known; they are no part of the request.
    `message_folders` finds those of the cores that it, or its specification, names as carriers of messages.
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
        """The items of a list parameter, each with its place; none where it is not given."""
        items = self.parameters.get(parameter) or []
        assert isinstance(items, list)
        places = self.places.get(parameter, ())
        return dict(zip(items, places if len(places) == len(items) else [None] * len(items), strict=True))


@dataclass(frozen=True)
class GeneratedFile:
    """A file of a generated core.

    `file_type` is FuseSoC's (`vhdlSource-93`, `user`, ...), `logical_name` the VHDL library, and `copyto` where in the
    work folder the tool finds it; "" leaves them out. An include file is one that others name.
    """

    content: str | bytes
    file_type: str
    logical_name: str = ""
    copyto: str = ""
    tags: tuple[str, ...] = ()
    is_include_file: bool = False


@dataclass(frozen=True)
class GeneratedCore:
    """A core as a generator returns it: files by path relative to the core, in the order in which a tool reads them."""

    description: str
    files: Mapping[str, GeneratedFile] = field(default_factory=dict)


@dataclass(frozen=True)
class LoadedRequest:
    """A request, and what it leads to, derived once.

    `inputs` are the files whose content the core depends on; a path of them need not exist. `generate` makes the core,
    `definitions` gives the library of each message with all definitions within it. Both raise `InputError`.
    """

    request: Request
    inputs: Sequence[Input]
    generate: Callable[[], GeneratedCore]
    definitions: Callable[[], Sequence[tuple[MessageLibrary, Definitions]]]


def as_files(core: GeneratedCore, request: Request) -> dict[str, bytes]:
    """The files to write for FuseSoC, by path; the `.core` is last, since with it the others are taken to be there.

    Raises `InputError` for a name that is too long for a file.
    """
    contents = {_checked(path): _encoded(file.content) for path, file in core.files.items()}
    return contents | {f"{request.name}.core": core_text(core, request.vlnv).encode()}


def _checked(path: str) -> str:
    """`path`, unless it is longer than file systems have it: entities are called after names that are joined."""
    for part in path.split("/"):
        if (size := len(part.encode())) > _LONGEST_FILE_NAME:
            fail(f"the file '{part[:40]}...' would have a name of {size} bytes; file systems take {_LONGEST_FILE_NAME}")
    return path


def core_text(core: GeneratedCore, vlnv: str) -> str:
    """The `.core` file, the same text for the same core."""
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
