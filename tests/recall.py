"""Results that tests recall: what a tool made of the same bytes before, in the same version of the tool.

Only what a tool did is recalled: what a test computes and asserts always runs, on the recalled outputs. A result is
stored if the tool succeeded, in the form of the product's store of results (fusesoc_firm/builds/step/results.py), in
the folder of FIRM_TEST_STORE (default: `fusesoc_firm_tests` in the user's cache). Like there, what is damaged is
missing.

    done = recalled({"tool": version, "entity": name}, [folder], run)
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Self

from fusesoc_firm.builds.step.contents import Contents
from fusesoc_firm.builds.step.results import Record, Results
from fusesoc_firm.builds.step.tree import FILE, FOLDER, LINK, PROGRAM, Item, Tree, changed, in_order_of_time, tree_of
from fusesoc_firm.tools.digests import digest_of
from fusesoc_firm.tools.facts import Fact

STORE = "FIRM_TEST_STORE"
"""The variable with the folder of what lasts from one run of tests to the next."""
FRESH = "FIRM_TEST_FRESH"
"""The variable that says, if it is not empty, that nothing is recalled."""
_BYTES = 8 * 2**30
# Changed when what a stored result means changes.
_FORMAT = 1
_MARK = "\0{}\0"
# A comment with a temporary folder as pytest names it: by the number of a run, of a process and of equal names. In a
# string, such a path would be that of an input.
_TEMPORARY = re.compile(
    rb"""^([^"\n]*?(?:--|//|/\*)[^"\n]*?)/[\w./-]*/pytest-of-[^/\s]+/pytest-\d+/(?:popen-gw\d+/)?[\w.-]+?\d+(?=/)""",
    re.MULTILINE,
)


@dataclass(frozen=True)
class RunResult:
    """A tool's run that has ended: `output` is what it printed on both streams, in lines."""

    exit_code: int
    output: str


def ran(command: Sequence[str], folder: Path | None) -> RunResult:
    """Run a tool in a folder."""
    done = subprocess.run(
        command,
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        check=False,
    )
    return RunResult(done.returncode, done.stdout)


@dataclass
class Counts:
    """The runs of tools whose results were recalled, and those that ran."""

    recalled: int = 0
    run: int = 0


COUNTS = Counts()
"""Of this process."""
contents = Contents()
"""The digests of files, of this process."""


def digest_of_source(path: Path) -> str:
    """The SHA-256 of a source without the paths of temporary folders of tests in comments, as in those of netlists."""
    return hashlib.sha256(_TEMPORARY.sub(rb"\1", path.read_bytes())).hexdigest()


@cache
def store() -> Results | None:
    """The store; None without FIRM_TEST_STORE, as for figures."""
    folder = os.environ.get(STORE)
    return Results(Path(folder), _BYTES) if folder else None


@cache
def identity(program: str) -> list[str]:
    """What tells one version of a tool from another: the bytes that PATH finds, and what it prints of itself."""
    path = shutil.which(program)
    if path is None:
        return [program]
    option = {"iverilog": "-V", "vvp": "-V"}.get(program, "--version")
    said = subprocess.run([path, option], capture_output=True, text=True, errors="replace", check=False)
    return [program, contents.digest(path) or "", said.stdout]


def recalled(
    parts: Mapping[str, object],
    folders: Sequence[Path],
    run: Callable[[], RunResult],
    paths: Sequence[Path] = (),
    left_out: Callable[[str], bool] = lambda _: False,
    read: Callable[[], Sequence[Path]] = tuple,
) -> RunResult:
    """Do what `run` does to the files of `folders`, or recall it.

    `parts` is all else that decides it, as plain data. The paths of the folders, and of `paths`, may differ from the
    run before: `parts` and the output are compared without them. Files whose names are `left_out` are no inputs and no
    outputs. `read` says, after the run, which other files it has read.
    """
    if (results := store()) is None:
        return run()
    marks = _Marks([*folders, *paths])
    before = _trees(folders, left_out)
    key = digest_of(
        {
            "format": _FORMAT,
            "parts": marks.without(parts),
            "inputs": [
                {path: _input(folder / path, item) for path, item in tree.items()}
                for folder, tree in zip(folders, before, strict=True)
            ],
        }
    )
    record = None if os.environ.get(FRESH) else results.record(key)
    if record and _is_valid(record, marks) and (output := _restored(results, record, folders)) is not None:
        COUNTS.recalled += 1
        return RunResult(0, marks.within(output))
    COUNTS.run += 1
    done = run()
    if done.exit_code == 0:
        outside = [path for path in read() if not any(path.is_relative_to(folder.resolve()) for folder in folders)]
        facts = tuple(("file", str(marks.without(str(path))), contents.digest(str(path))) for path in outside)
        with suppress(OSError):
            _keep(results, key, done.output, marks, folders, before, _trees(folders, left_out), facts)
    return done


def ran_or_recalled(command: Sequence[str], folder: Path) -> RunResult:
    """Run a tool in a folder, or recall what it did to the folder's files."""
    return recalled({"tool": identity(command[0]), "command": command}, [folder], lambda: ran(command, folder))


def _input(path: Path, item: Item) -> list[str]:
    """What decides a result of an item in a folder."""
    is_plain = item.kind in (FILE, PROGRAM) and not item.identity
    return [item.kind, digest_of_source(path)] if is_plain else item.key


def _is_valid(record: Record, marks: _Marks) -> bool:
    return all(contents.digest(marks.within(name)) == digest for _, name, digest in record.facts)


class Conversation:
    """A program that answers each line with lines, the last of which is `end`; what it said before is recalled.

    It must answer the same lines alike. It starts at the first line that it was not asked before, and is then asked
    all lines again. `ask` fails if it ends.
    """

    def __init__(self, command: Sequence[str], end: str) -> None:
        self._command, self._end = command, end
        parts = {"program": contents.digest(command[0]), "arguments": command[1:]}
        self._key = digest_of({"format": _FORMAT, **parts, "test": os.environ.get("PYTEST_CURRENT_TEST", "")})
        known = None if os.environ.get(FRESH) or not (results := store()) else results.note(self._key)
        self._known: list[Any] = known if isinstance(known, list) else []
        self._said: list[tuple[str, list[str]]] = []
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self._process is None:
            COUNTS.recalled += 1
            return
        COUNTS.run += 1
        self._process.kill()
        self._process.communicate()
        if kind is None and (results := store()):
            results.keep_note(self._key, self._said)

    def ask(self, row: str) -> list[str]:
        """Return the answer to a line, without its last line."""
        place = len(self._said)
        if self._process is None and place < len(self._known) and self._known[place][0] == row:
            answer = [str(line) for line in self._known[place][1]]
        else:
            if self._process is None:
                self._process = subprocess.Popen(
                    self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
                )
                for before, _ in self._said:
                    self._answer(before)
            answer = self._answer(row)
        self._said.append((row, answer))
        return answer

    def _answer(self, row: str) -> list[str]:
        assert self._process and self._process.stdin and self._process.stdout
        self._process.stdin.write(row)
        self._process.stdin.flush()
        answer: list[str] = []
        while (line := self._process.stdout.readline()) != self._end:
            assert line, f"{self._command[0]} ended"
            answer.append(line)
        return answer


def _trees(folders: Sequence[Path], left_out: Callable[[str], bool]) -> list[Tree]:
    return [
        {path: item for path, item in tree_of(folder, contents, is_exported=False).items() if not left_out(path)}
        for folder in folders
    ]


def _restored(results: Results, record: Record, folders: Sequence[Path]) -> str | None:
    """Write the outputs of a stored run; return what it printed, or None if a content is missing."""
    found = {name: results.content(name) for name in record.sizes}
    if None in found.values():
        return None
    for name, item in record.outputs.items():
        number, _, path = name.partition("/")
        _write(folders[int(number)] / path, item, found)
    for name in record.removed:
        number, _, path = name.partition("/")
        (folders[int(number)] / path).unlink()
    return (found[record.log] or b"").decode(errors="surrogateescape")


def _write(path: Path, item: Item, found: Mapping[str, bytes | None]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    if item.kind == FOLDER:
        path.mkdir(exist_ok=True)
    elif item.kind == LINK:
        path.unlink(missing_ok=True)
        path.symlink_to(item.digest)
    else:
        path.unlink(missing_ok=True)
        path.write_bytes(found[item.digest] or b"")
        path.chmod(0o755 if item.kind == PROGRAM else 0o644)


def _keep(
    results: Results,
    key: str,
    output: str,
    marks: _Marks,
    folders: Sequence[Path],
    before: Sequence[Tree],
    after: Sequence[Tree],
    facts: tuple[Fact, ...],
) -> None:
    """Store a run, unless an output contains a path that may differ the next time. May raise `OSError`."""
    sizes, outputs, removed = {}, {}, []
    for number, (folder, old, new) in enumerate(zip(folders, before, after, strict=True)):
        made = changed(old, new)
        for path in in_order_of_time(folder, made):
            item = made[path]
            outputs[f"{number}/{path}"] = item
            if item.kind in (FILE, PROGRAM):
                data = (folder / path).read_bytes()
                if any(os.fsencode(place) in data for place in folders):
                    return
                sizes[results.keep_content(data)] = len(data)
        removed += [f"{number}/{path}" for path in old if path not in new]
    text = str(marks.without(output)).encode(errors="surrogateescape")
    log = results.keep_content(text)
    sizes[log] = len(text)
    results.keep_record(key, Record(facts, outputs, tuple(removed), log, 0.0, sizes))


class _Marks:
    """Paths, the longer ones first, and what stands for each of them in what is stored."""

    def __init__(self, paths: Sequence[Path]) -> None:
        texts = list(dict.fromkeys(map(str, paths)))
        marks = [(text, _MARK.format(number)) for number, text in enumerate(texts)]
        self._marks = sorted(marks, key=lambda mark: -len(mark[0]))

    def without(self, data: object) -> object:
        """Plain data with a mark in place of each path."""
        if isinstance(data, str):
            return _replaced(data, self._marks)
        if isinstance(data, Mapping):
            return {name: self.without(value) for name, value in data.items()}
        if isinstance(data, Sequence):
            return [self.without(value) for value in data]
        return data

    def within(self, text: str) -> str:
        """A text with the paths of this run in place of the marks."""
        return _replaced(text, [(mark, path) for path, mark in self._marks])


def _replaced(text: str, pairs: Sequence[tuple[str, str]]) -> str:
    for old, new in pairs:
        text = text.replace(old, new)
    return text
