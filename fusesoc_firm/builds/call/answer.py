"""Answer FuseSoC's call of a generator.

FuseSoC starts a generator in an empty folder with one argument: a YAML file with the new core's name, the requesting
core's folder and the parameters. Afterwards, FuseSoC loads every `.core` file in the folder, so the generator writes
this file last. FuseSoC shows the generator's output to the user unchanged.

The data of a call are derived once (`Generator.load`): they determine the store's key and, after a miss, the generated
core. The state of every fact that determines the result is recorded before the fact is used. If one of these facts has
changed at the end, an input was edited during the call, and nothing is stored.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fusesoc_firm.builds.call import recall
from fusesoc_firm.builds.call.calls import make_request, read_call
from fusesoc_firm.builds.call.fusesoc_run import message_folders, run_of, write_core
from fusesoc_firm.builds.call.generators import GENERATORS, MESSAGES, Generator
from fusesoc_firm.builds.call.recall import LOCKED, SEARCHED, call_digest, hold, messages_fact
from fusesoc_firm.builds.call.requesting_core import find_requesting_core
from fusesoc_firm.builds.store import layout
from fusesoc_firm.builds.store.layout import CALL, read_note
from fusesoc_firm.builds.store.store import Entry, Files, Key, default_store, request_digest
from fusesoc_firm.core.core_reader import core_name
from fusesoc_firm.core.request import LoadedRequest, Request, as_files
from fusesoc_firm.text.diagnostics import Diagnostics, InputError, SourceRef, fail
from fusesoc_firm.tools import own_code
from fusesoc_firm.tools.digests import default_root
from fusesoc_firm.tools.facts import Fact, facts
from fusesoc_firm.tools.programs import explanation, missing
from fusesoc_firm.tools.reads import Input, Reads, noted

# FuseSoC removes this folder at the start of every run of a target.
_REMOVED = """this generator's folder was removed while the generator was running: the same target is run twice at once
      = 'firm build' runs targets safely in parallel"""


class _NotStoredError(Exception):
    """The requested core is not in the store."""


@dataclass
class Basis:
    """The facts that determine a result: the `reads` that determine the key, and `further` facts, first our own code.

    Each fact contains the state before its use. `run` is the id of FuseSoC's run.
    """

    run: str
    further: list[Fact] = field(default_factory=lambda: facts("code", [""]))
    reads: Reads = field(default_factory=Reads)

    @property
    def code(self) -> str | None:
        """The state of our own code before its use."""
        return next(state for kind, _, state in self.further if kind == "code")

    def facts(self) -> list[Fact]:
        """Return all facts of the basis."""
        return [*self.further, *self.reads.facts()]

    def holds(self) -> bool:
        """Return whether no fact has changed since its use."""
        return hold(self.facts(), self.run)


def main(command: str, argv: list[str], generators: Mapping[str, Generator] = GENERATORS) -> int:
    """Run the generator `command` with FuseSoC's arguments; return the exit status: 1 for faults, 130 for Ctrl-C."""
    try:
        if len(argv) != 1:
            fail(
                f"{command} is a generator that FuseSoC calls with one file; add it to the 'generate' section of a core"
            )
        _answer(command, generators[command], Path(argv[0]), run_of(os.getppid()))
    except InputError as error:
        print(error, file=sys.stderr)
        return 1
    except FileNotFoundError:
        if _is_here():
            raise
        print(f"{command}: error: {_REMOVED}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    return 0


def answer_from_store(command: str, path: Path) -> bool:
    """Answer a hit in FuseSoC's own process; for a miss or a faulty call, write nothing and return False.

    After a faulty call, the generator reports the faults.
    """
    run = run_of(os.getpid())
    try:
        if not recall.answer(command, [str(path)], run):
            _answer(command, GENERATORS[command], path, run, is_only_looked_up=True)
    except (InputError, _NotStoredError):
        return False
    return True


def noted_facts(command: str, path: Path) -> list[Fact] | None:
    """Return the facts that determine the answer of an answered call, or None if they are not noted."""
    note = read_note(default_root(), layout.place(call_digest(command, path.read_bytes()), CALL))
    return None if note is None else [(kind, name, state) for kind, name, state in note["facts"]]


def _answer(command: str, generator: Generator, path: Path, run: str, *, is_only_looked_up: bool = False) -> None:
    """Write the core for FuseSoC's file to the current folder, report it, and store a note for recall.

    May raise `InputError`. If `is_only_looked_up` is set, raise `_NotStoredError` for a miss.
    """
    start = time.monotonic()
    # The state of the code is recorded first, since its modules are imported from here on.
    basis = Basis(run)
    request = read_request(command, path, generator, run, basis.further)
    entry, absent, marks = fulfil(request, generator, basis, path.read_bytes(), is_only_looked_up=is_only_looked_up)
    _write(entry.files, request, marks, run)
    # The core can be generated although it cannot be run.
    if absent:
        print(f"{command}: {explanation(absent)}", flush=True)
    origin = "from store" if entry.is_from_store else "generated"
    print(f"{command}: {request.name} {origin} in {time.monotonic() - start:.2f} s", flush=True)


def read_request(
    command: str, path: Path, generator: Generator, run: str | None = None, further: list[Fact] | None = None
) -> Request:
    """Return the request in FuseSoC's file, with the folders of the message cores that `run` generated (None: any run).

    Add facts about these folders to `further`. May raise `InputError`.
    """
    generated = path.absolute().parent.parent

    def find(names: Mapping[str, SourceRef | None]) -> Sequence[Path]:
        if further is not None:
            further.extend(messages_fact(str(generated), core_name(name), run or "") for name in names)
        return _folders_of_run(names, str(generated), run)

    return make_request(read_call(path, command), generator.parameters, find)


def fulfil(
    request: Request, generator: Generator, basis: Basis, call: bytes, *, is_only_looked_up: bool = False
) -> tuple[Entry, list[str], str]:
    """Return the core for a request, the missing programs to run it, and the core whose messages it contains, or "".

    Store a note for FuseSoC's file `call`, so that `recall` can answer this call. Raise errors like `obtain`.
    """
    basis.further += facts("folder", _searched())
    basis.further += facts("program", generator.programs(request))
    absent = missing(generator.programs(request))
    loaded = load(request, generator, basis)
    is_locked = _check_locked(loaded)
    key, entry = obtain(loaded, generator, basis, is_only_looked_up=is_only_looked_up)
    marks = find_requesting_core(request.files_root, request.name).name if request.command == MESSAGES else ""
    # On every run, check calls with lock files and report missing programs, before the core is written: the current
    # folder may be in a searched folder.
    if not (absent or is_locked) and (basis.holds() if entry.is_from_store else entry.is_current):
        note = {"key": key.digest, "facts": basis.facts(), "name": request.name, "core": request.vlnv, "marks": marks}
        default_store().note(call_digest(request.command, call), note)
    return entry, absent, marks


def load(request: Request, generator: Generator, basis: Basis) -> LoadedRequest:
    """Derive the data of a request. May raise `InputError`."""
    with noted(basis.reads):
        return generator.load(request)


def obtain(
    loaded: LoadedRequest, generator: Generator, basis: Basis, *, is_only_looked_up: bool = False
) -> tuple[Key, Entry]:
    """Return the key and the core for a request; the core is from the store if possible.

    May raise `InputError`. If `is_only_looked_up` is set, raise `_NotStoredError` for a miss.
    """

    def build() -> Files:
        if is_only_looked_up:
            raise _NotStoredError
        reads = Reads()
        with noted(reads):
            core = loaded.generate()
        _check_declared(reads, basis.reads)
        return as_files(core, loaded.request)

    key = _key(loaded, generator, basis)
    return key, default_store().obtain(key, build, basis.holds)


def _key(loaded: LoadedRequest, generator: Generator, basis: Basis) -> Key:
    request = loaded.request
    tools = dict(generator.tools(request))
    basis.further += facts("program", sorted(tools))
    asked = {
        "command": request.command,
        "vlnv": request.vlnv,
        # A lock file does not change the generated core.
        "parameters": {name: value for name, value in request.parameters.items() if name != "locked"},
        "tools": tools,
    }
    for item in loaded.inputs:
        if isinstance(item, Path):
            basis.reads.note_file(str(item.absolute()))
    inputs = dict(_named_content(item, request) for item in loaded.inputs)
    about = {"core": request.vlnv, "generator": request.command}
    return Key(request_digest(asked, inputs, own_code.digest(current=basis.code)), about)


def _searched() -> list[str]:
    """Return the folders with message definitions that environment variables name."""
    entries = [entry for name in SEARCHED for entry in os.environ.get(name, "").split(os.pathsep) if entry]
    return [folder for entry in entries for folder in (entry, str(Path(entry, "share")))]


def _folders_of_run(names: Mapping[str, SourceRef | None], generated: str, run: str | None) -> tuple[Path, ...]:
    """Return the folders below `generated` with the messages of cores that `run` generated (None: any run).

    Raise `InputError` for a core without a folder, for example if the requesting core does not depend on that core.
    """
    faults = Diagnostics()
    found: list[Path] = []
    for name, source in names.items():
        current = message_folders(generated, core_name(name), run)
        if not current:
            hint = (
                f"the requesting core must depend on '{name}', whose target 'default' must use"
                " the generator firm_messages"
            )
            faults.error(f"core '{name}' provides no messages", source, hint)
        found += map(Path, current)
    faults.raise_if_any()
    return tuple(found)


def _check_locked(loaded: LoadedRequest) -> bool:
    """Check a request against its lock files; return whether there are lock files.

    Raise `InputError` for differences.
    """
    request = loaded.request
    places: list[Path] = []
    if name := request.parameters.get("locked"):
        places.append(request.files_root / str(name))
    if name := os.environ.get(LOCKED):
        if not Path(name).is_absolute():
            fail(f"{LOCKED} is '{name}'", hint=f"generators run in other folders, so write {LOCKED}=$PWD/{name}")
        places.append(Path(name))
    for place in places:
        from fusesoc_firm.builds.call.lock_file import check_request

        check_request(place, loaded)
    return bool(places)


def _check_declared(of_build: Reads, of_key: Reads) -> None:
    """Raise `InputError` if a file was read that the key does not cover, since edits would go unnoticed."""
    faults = Diagnostics()
    known = {os.path.realpath(file) for file in of_key.files}
    parts = {os.path.realpath(file) for file in of_key.parts}
    found = [(file, known) for file in of_build.files] + [(file, known | parts) for file in of_build.parts]
    for file, covered in found:
        if os.path.realpath(file) not in covered and Path(file).is_file():
            faults.error(
                f"{file} was read, but is not listed as an input",
                hint="add the file to the generator's parameter 'files'",
            )
    faults.raise_if_any()


def _write(files: Files, request: Request, marks: str, run: str) -> None:
    """Write a core to the current folder. May raise `InputError`."""
    try:
        found = write_core(files, request.vlnv, marks, run)
    except OSError as error:
        if not _is_here():
            raise
        fail(f"cannot write {error.filename}: {error.strerror}")
    if found:
        unit, other = found
        fail(
            f"{request.vlnv} and {other} define the design unit '{unit}' differently, but tools keep only one",
            find_requesting_core(request.files_root, request.name).instance(),
            "rename the units of one core with the generator's parameter 'name', for example 'name: left'",
        )


def _is_here() -> bool:
    """Return whether the current folder still exists."""
    try:
        return bool(Path.cwd())
    except FileNotFoundError:
        return False


def _name(path: Path, request: Request) -> str:
    """Return an input's name in the key, which is equal in all copies of a project."""
    folders = [folder for found in request.message_folders.found.values() for folder in found]
    for root in (request.files_root, *folders):
        if path.is_relative_to(root):
            number = folders.index(root) if root != request.files_root else None
            name = str(path.relative_to(root))
            return name if number is None else f"messages/{number}/{name}"
    return str(path)


def _named_content(item: Input, request: Request) -> tuple[str, bytes | None]:
    """Return an input's name in the key, and the content that the key covers, None if it is missing."""
    if isinstance(item, Path):
        return _name(item, request), item.read_bytes() if item.is_file() else None
    return f"{_name(item.path, request)}:{item.name}", item.content
