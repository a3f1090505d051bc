"""Generate cores that provide message definitions to other cores: the generator `firm_messages`.

A generator knows only the requesting core's folder. However, FuseSoC runs a core's generators after the generators of
the core's dependencies, each in a separate adjacent folder. This generator therefore copies a message core's
definitions, and a core that lists the message core in `messages` finds the copies in an adjacent folder (`plugin.run`).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from fusesoc_firm.core.request import GeneratedCore, GeneratedFile, LoadedRequest, Request
from fusesoc_firm.message.folders import interface_files
from fusesoc_firm.message.middleware import known_suffixes
from fusesoc_firm.text.diagnostics import SourceRef, fail


def load(request: Request) -> LoadedRequest:
    """Load a core with all definitions, including those of the listed cores, in one folder per package."""
    found = list(_files(request))
    # The messages are not parsed.
    return LoadedRequest(request, [path for _, path in found], lambda: _core(request, found), list)


def _core(request: Request, found: list[tuple[str, Path]]) -> GeneratedCore:
    files: dict[str, GeneratedFile] = {}
    for name, path in found:
        # If two folders contain the same file, the first folder takes precedence.
        files.setdefault(name, GeneratedFile(path.read_bytes(), "user"))
    if not files:
        fail(
            f"{request.name} contains no messages",
            request_place(request),
            "list the folders of the messages in 'paths'",
        )
    return GeneratedCore(f"Message definitions of {request.name}", files)


def request_place(request: Request) -> SourceRef | None:
    """Return the place in the requesting core that names the first folder."""
    return next(iter(request.listed("paths").values()), None)


def _files(request: Request) -> Iterator[tuple[str, Path]]:
    """Yield every file with its name in the generated core."""
    for folder in request.definition_folders():
        for kind, files in interface_files(folder, known_suffixes()).items():
            for name, paths in files.items():
                for path in paths:
                    yield f"{name.package}/{kind.value}/{path.name}", path
