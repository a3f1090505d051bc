"""Cores that carry message definitions for others to depend on: the generator `firm_messages`.

A generator sees the folder of the core that asks for it, and no others. But FuseSoC runs the generators of a core after
those of the cores that it depends on, each in a folder of its own, one beside the other. So a core of messages has its
definitions generated, that is copied, and who names this core in `messages` finds them beside its own folder
(`plugin.run`).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from fusesoc_firm.message.folders import interface_files
from fusesoc_firm.message.middleware import known_suffixes
from fusesoc_firm.request.request import GeneratedCore, GeneratedFile, LoadedRequest, Request
from fusesoc_firm.text.diagnostics import SourceRef, fail


def folders(request: Request) -> list[Path]:
    """Where a core's messages are: its own folders, then those of the cores that it names."""
    paths = request.parameters["paths"] or []
    assert isinstance(paths, list)
    return [*(request.files_root / path for path in paths), *request.message_folders.of(request.listed("messages"))]


def load(request: Request) -> LoadedRequest:
    """The definitions as a core, one folder a package, those of the cores that it names too."""
    found = list(_files(request))
    # None of them is parsed.
    return LoadedRequest(request, [path for _, path in found], lambda: _core(request, found), list)


def _core(request: Request, found: list[tuple[str, Path]]) -> GeneratedCore:
    files: dict[str, GeneratedFile] = {}
    for name, path in found:
        # Of two folders the first one counts.
        files.setdefault(name, GeneratedFile(path.read_bytes(), "user"))
    if not files:
        fail(f"{request.name} has no messages", request_place(request), "'paths' lists their folders")
    return GeneratedCore(f"Message definitions of {request.name}", files)


def request_place(request: Request) -> SourceRef | None:
    """Where the first of a core's folders is named."""
    return next(iter(request.listed("paths").values()), None)


def _files(request: Request) -> Iterator[tuple[str, Path]]:
    """Every file with its name in the generated core."""
    for folder in folders(request):
        for kind, files in interface_files(folder, known_suffixes()).items():
            for name, paths in files.items():
                for path in paths:
                    yield f"{name.package}/{kind.value}/{path.name}", path
