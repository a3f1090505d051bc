"""Console blocks of pages: run as a reader would, and compared with what the page shows.

    ```console
    $ firm message show geometry_msgs/Point
    geometry_msgs/Point ...
    ```

The blocks of a page run in order, as in one shell: a command begins in the folder and with the exported variables of
the one before it, at first in a new folder. A line `...` of the output stands for
any lines: what follows it, up to the next, is found by its first line. HTML comments on
the line before a block say what a reader of the rendered page need not:

    <!-- not run: it needs a board -->        the block is shown only
    <!-- in the checkout -->                  it runs in the checkout, not in the page's folder
    <!-- file: robot.yaml -->                 the block, in any language, is written to that file, from the first folder
    <!-- installs -->                         it runs, without a comparison, if a session begins with an installation

Times are compared as `0 s`. A picture that a page shows must be made by one of its commands, by `-o FILE` of that name,
or be in `TESTED_PICTURES`; its words are compared, as coordinates differ between versions of Graphviz.
"""

from __future__ import annotations

import difflib
import os
import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests.hdl.ghdl import REPOSITORY
from tools.pages.page import Page

TESTED_PICTURES = frozenset({"house.svg", "terminal.svg", "waves.svg"})
"""Pictures that separate tests compare with the code."""
_ELISION = "..."
_COMMENT = re.compile(
    r"<!-- (?:(?P<checkout>in the checkout)|(?P<installs>installs)|(?P<kind>not run|file): (?P<value>.+?)) -->"
)
_TIME = re.compile(r"\b\d+(\.\d+)?(?= (s|ms|seconds)\b)")
# What make and Edalize say about folders; `make sim` leaves it out, too.
_FOLDERS = re.compile(r"(make\[\d+\]: )?(Entering|Leaving) directory '")
_SECONDS = 300
# What a page calls this checkout, and the end of a command: its folder and variables are those of the next one.
_CHECKOUT = "/path/to/checkout"
_KEEP = """trap '{ pwd; env --null; } >"$PAGE_STATE"' EXIT"""


@dataclass(frozen=True)
class Block:
    """A console block or a file; lines count from 0, `end` is that of the closing fence."""

    begin: int
    end: int
    lines: tuple[str, ...]
    comment: re.Match[str] | None

    @property
    def file(self) -> str:
        """The file that the block is written to; empty for a console block."""
        return self.comment["value"] if self.comment and self.comment["kind"] == "file" else ""

    @property
    def reason(self) -> str:
        """Why it is not run; empty if it is."""
        return self.comment["value"] if self.comment and self.comment["kind"] == "not run" else ""

    @property
    def is_in_checkout(self) -> bool:
        """Whether it runs in the checkout."""
        return bool(self.comment and self.comment["checkout"])

    @property
    def installs(self) -> bool:
        """Whether it installs the product."""
        return bool(self.comment and self.comment["installs"])

    def steps(self) -> Iterator[tuple[str, list[str]]]:
        """Each command, `\\` at an end of line included, with the lines that it is to print."""
        lines = list(self.lines)
        while lines:
            command = [lines.pop(0)]
            while command[-1].endswith("\\"):
                command.append(lines.pop(0))
            output = []
            while lines and not lines[0].startswith("$ "):
                output.append(lines.pop(0))
            yield "\n".join(command), output


@dataclass
class Session:
    """A reader at a terminal, in a folder of their own; with `installs`, the reader installs the product first."""

    folder: Path
    installs: bool = False
    made: dict[str, Path] = field(default_factory=dict)
    _here: Path = field(init=False)
    _variables: dict[str, str] = field(init=False)

    def __post_init__(self) -> None:
        self._here, self._variables = self.folder, self._environment()

    def run(self, command: str, block: Block) -> list[str]:
        """What the command of a block prints; paths of this machine are those of any other.

        Raises:
            RuntimeError: the command failed and told of no error

        """
        folder = REPOSITORY if block.is_in_checkout else self._here
        script = command.removeprefix("$ ").replace(_CHECKOUT, str(REPOSITORY))
        done = subprocess.run(
            ["bash", "-c", f"{_KEEP}\n{script}"],
            cwd=folder,
            env=self._variables,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=_SECONDS,
            check=False,
        )
        if done.returncode and "error" not in done.stdout:
            raise RuntimeError(f"{command}: exit status {done.returncode}\n{done.stdout}")
        if not block.is_in_checkout:
            here, _, variables = self._state.read_text(encoding="utf-8").partition("\n")
            self._here = folder = Path(here)
            self._variables = dict(item.split("=", 1) for item in variables.split("\0") if item)
        for path in re.findall(r" -o (\S+)", command):
            self.made[Path(path).name] = folder / path
        text = done.stdout.replace(str(self.folder), "/home/me").replace(str(REPOSITORY), "/home/me/fusesoc_firm")
        return [line.rstrip() for line in text.splitlines() if not _FOLDERS.match(line)]

    def _environment(self) -> dict[str, str]:
        kept = {name: os.environ[name] for name in ("PATH", "LANG", "FUSESOC_FIRM_CACHE") if name in os.environ}
        programs = kept.get("PATH", os.defpath)
        if not self.installs:
            programs = f"{Path(sys.executable).parent}:{programs}"
        home = self.folder / ".home"
        home.mkdir(exist_ok=True)
        further = {"COLUMNS": "100", "PYTHONUNBUFFERED": "1", "FIRM_PROGRESS": "no", "PAGE_STATE": str(self._state)}
        return kept | {"PATH": programs, "HOME": str(home), **further}

    @property
    def _state(self) -> Path:
        return self.folder / ".home" / "state"


def blocks(page: Page) -> Iterator[Block]:
    """The page's console blocks and files."""
    lines = page.text.splitlines()
    for token in page.tokens:
        if token.type == "fence" and token.map:
            begin, end = token.map
            comment = _COMMENT.fullmatch(lines[begin - 1])
            block = Block(begin + 1, end - 1, tuple(token.content.splitlines()), comment)
            if token.info == "console" or block.file:
                yield block


def check(page: Page, folder: Path, *, is_updated: bool = False, installs: bool = False) -> list[str]:
    """Run the page's blocks; the differences, or none where `is_updated` writes them into the page.

    With `installs`, the page's own commands install the product.
    """
    session = Session(folder, installs)
    faults: list[str] = []
    lines = page.text.splitlines()
    shift = 0
    for block in blocks(page):
        if block.file:
            (folder / block.file).parent.mkdir(parents=True, exist_ok=True)
            (folder / block.file).write_text("".join(f"{line}\n" for line in block.lines), encoding="utf-8")
        elif block.installs:
            for command, _ in block.steps() if installs else ():
                session.run(command, block)
        elif not block.reason:
            shown = [line for step in block.steps() for line in _shown(step, session.run(step[0], block))]
            if not is_updated:
                faults += _difference(f"{page.name}:{block.begin + 1}", block.lines, shown)
            lines[block.begin + shift : block.end + shift] = shown
            shift += len(shown) - len(block.lines)
    if is_updated and lines != page.text.splitlines():
        page.file.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    return faults + list(_pictures(page, session.made, is_updated=is_updated))


def _shown(step: tuple[str, list[str]], output: list[str]) -> list[str]:
    """What the page should show of a command: its output, elided where the page elides it."""
    command, expected = step
    if _ELISION not in expected:
        return [*command.splitlines(), *output]
    head, *middle, tail = _parts(expected)
    shown = output[: len(head)]
    for part in middle:
        found = next(
            (n for n, line in enumerate(output) if _TIME.sub("0", line) == _TIME.sub("0", part[0])), len(output)
        )
        shown += [_ELISION, *output[found : found + len(part)]]
    return [*command.splitlines(), *shown, _ELISION, *output[len(output) - len(tail) :]]


def _parts(lines: list[str]) -> Iterator[list[str]]:
    """The lines between elisions; the last is shorter where the output is."""
    while _ELISION in lines:
        end = lines.index(_ELISION)
        yield lines[:end]
        lines = lines[end + 1 :]
    yield lines


def _difference(place: str, expected: Sequence[str], found: Sequence[str]) -> list[str]:
    shown, printed = ([_TIME.sub("0", line) for line in lines] for lines in (expected, found))
    return list(difflib.unified_diff(shown, printed, place, "printed", lineterm=""))


def _pictures(page: Page, made: dict[str, Path], *, is_updated: bool) -> Iterator[str]:
    for link in page.links:
        if link.is_picture and link.file.name not in TESTED_PICTURES:
            picture = made.get(link.file.name)
            if picture is None:
                yield f"{page.name}:{link.line}: no command of the page makes {link.file.name}"
            elif is_updated:
                link.file.parent.mkdir(exist_ok=True)
                link.file.write_bytes(picture.read_bytes())
            elif words(picture) != words(link.file):
                yield f"{page.name}:{link.line}: {link.file.name} is not what its command makes"


def words(picture: Path) -> list[str]:
    """The texts of an SVG, sorted."""
    return sorted(re.findall(r"<text\b[^>]*>([^<]*)</text>", picture.read_text(encoding="utf-8")))
