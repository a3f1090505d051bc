"""Answers a generator call as it was answered before, if nothing is different that decided the answer.

The store's key says what decides a result. But to make it, a specification is read and a system derived from it, which
takes longer than all else where nothing has changed. So a call that was answered leaves a note in the store: the key,
and the facts that it follows from, each with its state at that time. These are

    file        each one that was read to make the key, that the key covers, and of our own: its SHA-256
    part        each file of which a part was read: its size and time
    folder      each one that was searched, and those that the environment names: which names are in it
    code        the names of all our own files
    program     one that makes part of the result, or runs it: the file that the PATH leads to, its size and time
    messages    a core whose messages are used: the folders that this run of FuseSoC made of it

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
from collections.abc import Sequence

from fusesoc_firm.store.design_units import clash, note_units, units_of
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
from fusesoc_firm.store.message_runs import mark_run, marked_folders, run_of
from fusesoc_firm.store.own_code import PACKAGE, all_names
from fusesoc_firm.text.files import hide_generated, read_file, write_if_changed

IMPORTED = ("chevron", "numpy", "pyyaml", "rosbags")
"""What generated text can depend on beside our own code."""
SEARCHED = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")
"""Variables with folders where message definitions are searched."""
LOCKED = "FUSESOC_FIRM_LOCKED"
"""Names the lock file that every call must comply with."""

Fact = tuple[str, str, str | None]
"""Kind, name and state; None as the state of what is not there."""


def answer(command: str, arguments: Sequence[str]) -> bool:
    """Write the core that a call asks for; False, and nothing is written, if the call was not answered before.

    What was written of a core that cannot be written as a whole is written again by whoever reports that.
    """
    start = time.monotonic()
    call = read_file(arguments[0]) if len(arguments) == 1 else None
    if call is None or os.environ.get(LOCKED):
        return False
    root = default_root()
    noted = place(call_digest(command, call), CALL)
    note = read_note(root, noted)
    if note is None or any(state(kind, name) != was for kind, name, was in note["facts"]):
        return False
    stored = place(note["key"], ENTRY)
    if (found := read_entry(root, stored)) is None:
        return False
    mark_used(root, stored, noted)
    units, run = units_of(found[1]), run_of(os.getppid())
    if clash("", units, run):
        return False
    try:
        hide_generated()
        for name, content in found[1].items():
            write_if_changed(name, content)
        if note["marks"]:
            mark_run("", note["marks"])
        note_units("", note["core"], units, run)
    except OSError:
        return False
    print(f"{command}: {note['name']} from store in {time.monotonic() - start:.2f} s", flush=True)
    return True


def call_digest(command: str, call: bytes) -> str:
    """What names the note of a call: the file that FuseSoC wrote for it, and the Python that answers."""
    searched = [os.environ.get(name) for name in SEARCHED]
    python = [sys.version, os.uname().machine, _c_library(), _packages(), str(PACKAGE)]
    return digest_of([command, digest(call), searched, python])


def state(kind: str, name: str) -> str | None:
    """The present state of what decides a result; None if it is not there, or the name is of no such thing."""
    try:
        return _state(kind, name)
    except (ValueError, TypeError, RecursionError):
        # A note of others may hold anything.
        return None


def _state(kind: str, name: str) -> str | None:
    if kind == "file":
        content = read_file(name)
        return None if content is None else digest(content)
    if kind == "part":
        return _part(name)
    if kind == "folder":
        return _folder(name)
    if kind == "code":
        return digest_of(all_names())
    if kind == "program":
        return _program(name)
    if kind == "messages":
        generated, core = json.loads(name)
        return json.dumps(marked_folders(generated, core))
    # That of another version of this module.
    return None


def facts(kind: str, names: Sequence[str]) -> list[Fact]:
    """These facts in their present state."""
    return [(kind, name, state(kind, name)) for name in names]


def _folder(path: str) -> str | None:
    try:
        with os.scandir(path) as entries:
            return digest_of(sorted([entry.name, entry.is_dir()] for entry in entries))
    except OSError:
        return None


def _part(path: str) -> str | None:
    try:
        status = os.stat(path)
    except OSError:
        return None
    return f"{status.st_size} {status.st_mtime_ns}"


def _program(name: str) -> str | None:
    for folder in os.environ.get("PATH", os.defpath).split(os.pathsep):
        path = os.path.join(folder, name)
        if os.path.isfile(path) and os.access(path, os.X_OK):
            status = os.stat(path)
            return f"{os.path.realpath(path)} {status.st_size} {status.st_mtime_ns}"
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
