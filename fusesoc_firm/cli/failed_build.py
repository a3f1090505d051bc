"""What a failed build says: the first error in its log, with the places of the user's own files."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fusesoc_firm.builds.setup.outcome import Build
    from fusesoc_firm.system.system_core import LoadedSystem
    from fusesoc_firm.text.diagnostics import SourceRef

_MOST_LINES = 30
# GHDL's errors begin with a place only.
_ERROR = re.compile(r"(?:\b|:)error\b|\(assertion failure\)|^Traceback|^\S+:\d+:\d+: ", re.IGNORECASE)
# Lines of FuseSoC, Edalize and make around the message of the tool that failed.
_NOISE = re.compile(
    r"(INFO|WARNING): |make(\[\d+\])?: |ERROR: (Failed to (build|run)|.* exited with an error)|far: "
    r"|Info: |(Entering|Leaving) directory |\S+ -m fusesoc_firm\.cli tool "
)
# A place in a file that FuseSoC copied into the build folder.
_COPY = re.compile(r"(?<!\S)src/[^/\s]+/(?P<path>[^\s:]+):(?P<line>\d+)\b")


def print_errors(build: Build, folder: Path | None, loaded: LoadedSystem | None) -> None:
    """Print `error_lines` on standard error."""
    for line in error_lines(build, folder, loaded):
        print(line, file=sys.stderr)


def error_lines(build: Build, folder: Path | None, loaded: LoadedSystem | None) -> Iterator[str]:
    """Yield the lines of the log from the first error on, or its last lines.

    Copies are named after their originals. A line of a generated file is followed by its line of the specification.
    """
    lines = [line for line in build.log.read_text(encoding="utf-8").splitlines() if not _NOISE.match(line)]
    first = next((number for number, line in enumerate(lines) if _ERROR.search(line)), max(0, len(lines) - _MOST_LINES))
    here = f"{Path.cwd().resolve()}/"
    for line in (text.removeprefix(here) for text in lines[first : first + _MOST_LINES]):
        place = _COPY.search(line)
        original = _original(place, build.work_root, folder) if place else None
        yield f"{line[: place.start()]}{original}:{place['line']}{line[place.end() :]}" if place and original else line
        if place and not original and loaded and (source := _origin(place, build.work_root, loaded)):
            yield f"      = this generated line belongs to {source}"


def _original(copy: re.Match[str], work_root: Path, folder: Path | None) -> Path | None:
    """Return the path of the user's file with the content of a copy."""
    parts = Path(copy["path"]).parts
    content = _content(copy, work_root)
    for number in range(len(parts) if folder and content is not None else 0):
        path = Path(folder or "", *parts[number:])
        if path.is_file() and path.read_bytes() == content:
            return path
    return None


def _content(copy: re.Match[str], work_root: Path) -> bytes | None:
    path = work_root / copy[0].rpartition(":")[0]
    return path.read_bytes() if path.is_file() else None


def _origin(copy: re.Match[str], work_root: Path, loaded: LoadedSystem) -> SourceRef | None:
    from fusesoc_firm.accelerator.origin import origin

    lines = (_content(copy, work_root) or b"").decode(errors="replace").splitlines()
    return origin(loaded, Path(copy["path"]).stem, lines, int(copy["line"]))
