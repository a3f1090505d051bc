"""Answers a generator call as it was answered before, if nothing is different that decided the answer.

The store's key says what decides a result. But to make it, a specification is read and a system derived from it, which
takes longer than all else where nothing has changed. So a call that was answered leaves a note in the store: the key,
and the facts that it follows from (`store.facts`). Of one kind of facts only a run of FuseSoC can tell:

    messages    a core whose messages are used: the folders that this run made of it

A call, as FuseSoC writes it, with the versions of Python and of the packages that we import, names the note. If each
fact has the state it had, the key would be the same, so the entry is the answer. If one has not, or anything is out of
the ordinary, nothing is answered here, and the key is made. So this module only ever saves time.

It runs before anything else of this package, and imports next to nothing.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterable, Sequence

from fusesoc_firm.plugin.run import message_folders, run_of, write_core
from fusesoc_firm.store import facts
from fusesoc_firm.store.layout import (
    CALL,
    ENTRY,
    default_root,
    digest,
    digest_of,
    mark_used,
    place,
    read_entry,
    read_note,
)
from fusesoc_firm.store.own_code import IMPORTED, PACKAGE
from fusesoc_firm.text.files import read_file

SEARCHED = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")
"""Variables with folders where message definitions are searched."""
LOCKED = "FUSESOC_FIRM_LOCKED"
"""Names the lock file that every call must comply with."""


def answer(command: str, arguments: Sequence[str], run: str = "") -> bool:
    """Write the core that a call asks for; False, and nothing is written, if the call was not answered before.

    Unless a `run` is given, it is that of the process that started this one. After a failed write, the caller rewrites
    the whole core and reports the error.
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
    """What names the note of a call: the file that FuseSoC wrote for it, and the Python that answers."""
    searched = [os.environ.get(name) for name in SEARCHED]
    python = [sys.version, os.uname().machine, _c_library(), _packages(), str(PACKAGE)]
    return digest_of([command, digest(call), searched, python])


def messages_fact(generated: str, core: str, run: str) -> facts.Fact:
    """The folders below `generated` with the messages of a core."""
    name = json.dumps([generated, core])
    return "messages", name, state("messages", name, run)


def hold(noted: Iterable[facts.Fact], run: str) -> bool:
    """Whether facts are still as they were noted."""
    return all(state(kind, name, run) == was for kind, name, was in noted)


def state(kind: str, name: str, run: str) -> str | None:
    """The present state of a fact; None if what it is of is not there, or is no such thing."""
    try:
        if kind == "messages":
            generated, core = json.loads(name)
            return json.dumps(message_folders(generated, core, run))
        return facts.state(kind, name)
    except (OSError, ValueError, TypeError, RecursionError):
        # A note of others may hold anything, and a file of ours may be replaced just now.
        return None


def _packages() -> list[list[object]]:
    """Every installed version of what we import, where Python looks for it."""
    found: list[list[object]] = []
    for folder in sys.path:
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
