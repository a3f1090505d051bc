"""Cores that carry message definitions for others to depend on: the generator `firm_messages`.

A generator sees the folder of the core that asks for it, and no others. But FuseSoC runs the generators of a core after
those of the cores that it depends on, each in a folder of its own, one beside the other. So a core of messages has its
definitions generated, that is copied, and who names this core in `messages` finds them beside its own folder
(`message_runs`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from fusesoc_firm.message.folders import interface_files
from fusesoc_firm.message.middleware import known_suffixes
from fusesoc_firm.request.core_reader import core_name
from fusesoc_firm.request.request import GeneratedCore, GeneratedFile, Request
from fusesoc_firm.store.message_runs import marked_folders
from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef


def folders(request: Request) -> list[Path]:
    """Where a core's messages are: its own folders, then those of the cores that it names."""
    paths = request.parameters["paths"] or []
    assert isinstance(paths, list)
    return [*(request.files_root / path for path in paths), *request.folders_of(request.listed("messages"))]


def inputs(request: Request) -> list[Path]:
    """Every file that defines messages."""
    return [path for _, path in _files(request)]


def generate(request: Request) -> GeneratedCore:
    """The definitions as a core, one folder a package, those of the cores that it names too. Raises `InputError`."""
    faults = Diagnostics()
    files: dict[str, GeneratedFile] = {}
    for name, path in _files(request):
        # Of two folders the first one counts.
        files.setdefault(name, GeneratedFile(path.read_bytes(), "user"))
    if not files:
        faults.error(f"{request.name} has no messages", request_place(request), "'paths' lists their folders")
    faults.raise_if_any()
    return GeneratedCore(f"Message definitions of {request.name}", files)


def request_place(request: Request) -> SourceRef | None:
    """Where the first of a core's folders is named."""
    return next(iter(request.listed("paths").values()), None)


def folders_of_run(
    names: Mapping[str, SourceRef | None], generated: Path, *, is_this_run: bool = True
) -> tuple[Path, ...]:
    """The folders, below `generated`, of the messages of cores; unless it `is_this_run`, of any run.

    Raises `InputError` for a core that has none, as it has if the requesting core does not depend on it.
    """
    faults = Diagnostics()
    found: list[Path] = []
    for name, source in names.items():
        current = [Path(path) for path in marked_folders(str(generated), core_name(name), is_this_run=is_this_run)]
        if not current:
            hint = "the requesting core depends on it, and it has the generator firm_messages in its target 'default'"
            faults.error(f"there are no messages of core '{name}'", source, hint)
        found += current
    faults.raise_if_any()
    return tuple(found)


def _files(request: Request) -> Iterator[tuple[str, Path]]:
    """Every file with its name in the generated core."""
    for folder in folders(request):
        for kind, files in interface_files(folder, known_suffixes()).items():
            for name, paths in files.items():
                for path in paths:
                    yield f"{name.package}/{kind.value}/{path.name}", path
