"""Repeat the result of an earlier generator call if no fact that determined the result has changed.

The store's key covers everything that determines a result. To compute the key, a specification must be read and a
system derived; for a hit, this takes longer than all other work. Each answered call therefore leaves a note in the
store: the key, and the facts that determine the key (`store.facts`). One kind of fact depends on the run of FuseSoC:

    messages    a message core in use: the folders that this run generated for the core

The note's name is the digest of FuseSoC's file for the call and of the versions of Python and the packages that we
import. If each fact has its recorded state, the key would be the same, so the entry is the result. If a fact has
changed, or in any unusual situation, this module does nothing, and the key is computed. The module therefore affects
only the duration of a call.

The module runs before all other modules of this package, and imports almost nothing.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterable, Sequence
from functools import lru_cache

from fusesoc_firm.builds.call.fusesoc_run import message_folders, run_of, write_core
from fusesoc_firm.builds.store.layout import CALL, ENTRY, mark_used, place, read_entry, read_note
from fusesoc_firm.text.files import read_file
from fusesoc_firm.tools import facts
from fusesoc_firm.tools.digests import default_root, digest, digest_of
from fusesoc_firm.tools.own_code import IMPORTED, PACKAGE

SEARCHED = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")
"""The environment variables that list folders with message definitions."""
LOCKED = "FUSESOC_FIRM_LOCKED"
"""The environment variable that names the lock file with which every call must comply."""


def answer(command: str, arguments: Sequence[str], run: str = "") -> bool:
    """Write the core for a call if the call is a hit; otherwise write nothing and return False.

    Without a `run`, the run is that of the parent process. After a failed write, the caller rewrites the whole core and
    reports the error.
    """
    start = time.monotonic()
    call = read_file(arguments[0]) if len(arguments) == 1 else None
    if call is None or os.environ.get(LOCKED):
        return False
    run = run or run_of(os.getppid())
    root = default_root()
    noted = place(call_digest(command, call), CALL)
    note = read_note(root, noted)
    if note is None or not hold(note["facts"], run):
        return False
    stored = place(note["key"], ENTRY)
    if (found := read_entry(root, stored)) is None:
        return False
    mark_used(root, stored, noted)
    try:
        if write_core(found[1], note["core"], note["marks"], run):
            return False
    except OSError:
        return False
    print(f"{command}: {note['name']} from store in {time.monotonic() - start:.2f} s", flush=True)
    return True


def call_digest(command: str, call: bytes) -> str:
    """Return the name of a call's note: a digest of FuseSoC's file for the call and of the Python in use."""
    searched = [os.environ.get(name) for name in SEARCHED]
    python = [sys.version, os.uname().machine, _c_library(), _packages(tuple(sys.path)), str(PACKAGE)]
    return digest_of([command, digest(call), searched, python])


def messages_fact(generated: str, core: str, run: str) -> facts.Fact:
    """Return the fact about the folders below `generated` with the messages of a core."""
    name = json.dumps([generated, core])
    return "messages", name, state("messages", name, run)


def hold(noted: Iterable[facts.Fact], run: str) -> bool:
    """Return whether all facts are in their recorded states."""
    return facts.hold(noted, lambda kind, name: state(kind, name, run))


def state(kind: str, name: str, run: str) -> str | None:
    """Return the current state of a fact, or None if the object is missing or of another kind."""
    try:
        if kind == "messages":
            generated, core = json.loads(name)
            return json.dumps(message_folders(generated, core, run))
        return facts.state(kind, name)
    except (OSError, ValueError, TypeError, RecursionError):
        # A note written by another user may contain anything, and one of our files may be changing at this moment.
        return None


@lru_cache(maxsize=1)
def _packages(folders: tuple[str, ...]) -> list[list[object]]:
    """Return every installed version of the packages that we import, for each folder on Python's path."""
    found: list[list[object]] = []
    for folder in folders:
        try:
            with os.scandir(folder or ".") as entries:
                named = [(entry.name.lower(), entry) for entry in entries if entry.name.endswith("-info")]
                found += [
                    [folder, name, entry.stat().st_mtime_ns]
                    for name, entry in sorted(named, key=lambda item: item[0])
                    if name.partition("-")[0].partition(".")[0] in IMPORTED
                ]
        except OSError:
            continue
    return found


def _c_library() -> str | None:
    try:
        return os.confstr("CS_GNU_LIBC_VERSION")
    except (OSError, ValueError):
        return None
