"""The lock file of a system, which records the message definitions, cores and tools for later builds.

The author of a core may change its files, so these are not locked; everything from other sources is locked. `firm`
checks a whole core against its lock file (`check_lock`). A generator checks only its own request (`check_request`),
since it knows neither the other cores nor the programs of a target. FuseSoC's `--lockfile` reads the list of cores, in
which each version is fixed; the core itself and generated cores are in the list without a digest. FuseSoC would
rewrite the file, without our parts, if a core were missing in the list.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from fusesoc_firm.builds.setup.cores import ProjectCore
from fusesoc_firm.core.request import LoadedRequest
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.signature import signature
from fusesoc_firm.text.diagnostics import Diagnostics, fail
from fusesoc_firm.text.yaml_text import data_in, yaml_dump
from fusesoc_firm.tools.digests import digest
from fusesoc_firm.tools.programs import debian_package, facts_of, installed_programs, packages

Lock = Mapping[str, Mapping[str, Mapping[str, str]]]
"""Facts by kind (`messages`, `cores`, `tools`), by the item's name, and by the fact's name."""

_PACKAGES = ("chevron", "edalize", "fusesoc", "fusesoc-firm", "numpy", "pyyaml", "rosbags")
_HEAD = "# Written by 'firm lock', checked by 'firm lock --locked'. Keep this file under version control.\n"
_FUSESOC_VERSION = 1
"""The version of FuseSoC's format of lock files."""
_WORDS = {"messages": "message", "cores": "core", "tools": "tool"}


def lock_path(core: ProjectCore) -> Path:
    """Return the path of a core's lock file, next to its `.core` file."""
    return core.files[0].with_suffix(".lock")


def lock_of(generated: Sequence[LoadedRequest], cores: Mapping[str, str]) -> Lock:
    """Return the definitions, cores and tools that a core now uses, directly or through its dependencies.

    `generated` are the derived requests, those of the core itself first; `cores` maps the names of the dependencies to
    the digests of their inputs. If two cores use a message from different sources, the message is listed for each core.
    """
    messages: dict[str, dict[str, str]] = {}
    for loaded in generated:
        for label, facts in _messages(loaded).items():
            if messages.setdefault(label, facts) != facts:
                messages[_of_request(label, loaded)] = facts
    return {
        "messages": dict(sorted(messages.items())),
        "cores": {name: {"sha256": digest} for name, digest in cores.items()},
        "tools": _tools(),
    }


def lock_text(lock: Lock, others: Iterable[str] = ()) -> str:
    """Return the text of a lock file; `others` are the cores without digests."""
    data: dict[str, Any] = {kind: {name: dict(facts) for name, facts in items.items()} for kind, items in lock.items()}
    cores = [{"name": name, **facts} for name, facts in lock["cores"].items()]
    data["cores"] = [*({"name": name} for name in dict.fromkeys(others) if name not in lock["cores"]), *cores]
    return _HEAD + yaml_dump({"lockfile_version": _FUSESOC_VERSION, **data})


def read_lock(path: Path) -> Lock:
    """Read a lock file. Raise `InputError` if it is unreadable or invalid."""
    try:
        data: Any = data_in(path)
        listed = {str(core["name"]): {**core} for core in data["cores"]}
        cores = {name: {"sha256": core["sha256"]} for name, core in listed.items() if "sha256" in core}
        kinds = {**data, "cores": cores}
        return {kind: {str(name): dict(facts) for name, facts in kinds[kind].items()} for kind in _WORDS}
    except OSError as error:
        fail(f"cannot read {path}: {error.strerror}", hint="run 'firm lock' to write the file")
    except (yaml.YAMLError, KeyError, TypeError, ValueError, AttributeError):
        fail(f"{path} is not a lock file", hint="run 'firm lock' to rewrite the file")


def check_lock(locked: Lock, used: Lock) -> None:
    """Raise `InputError` with every difference between the used and the locked items.

    An installed program that is not locked is not a difference, since the locked build did not need this program.
    """
    faults = Diagnostics()
    for difference in _differences(locked, used):
        faults.error(difference)
    faults.raise_if_any()


def check_request(path: Path, loaded: LoadedRequest) -> None:
    """Raise `InputError` if the messages and packages of a request differ from a lock file."""
    locked = read_lock(path)
    faults = Diagnostics()
    for label, now in _messages(loaded).items():
        was = locked["messages"].get(_of_request(label, loaded), locked["messages"].get(label))
        for difference in _difference("message", label, was, now):
            faults.error(difference, hint=f"according to {path}")
    for name, now in packages(_PACKAGES).items():
        if (was := locked["tools"].get(name)) is not None:
            for difference in _difference("tool", name, was, now):
                faults.error(difference, hint=f"according to {path}")
    faults.raise_if_any()


def _differences(locked: Lock, used: Lock) -> Iterator[str]:
    for kind, word in _WORDS.items():
        for name in sorted(locked[kind].keys() | used[kind].keys()):
            was, now = locked[kind].get(name), used[kind].get(name)
            if now is None:
                yield f"{word} {name} is locked, but not {'installed' if kind == 'tools' else 'used'}"
            elif was is not None or kind != "tools":
                yield from _difference(word, name, was, now)


def _difference(word: str, name: str, was: Mapping[str, str] | None, now: Mapping[str, str]) -> Iterator[str]:
    """Yield the differences between a used item and its locked state."""
    if was is None:
        yield f"{word} {name} is used, but not locked"
        return
    for fact in sorted(was.keys() | now.keys()):
        if was.get(fact) != now.get(fact):
            yield f"{word} {name}: {fact} is {now.get(fact)}, but the lock file has {was.get(fact)}"


def _messages(loaded: LoadedRequest) -> dict[str, dict[str, str]]:
    """Return the facts of each message that a request uses."""
    return {
        f"{name} ({library.ros.title})": _message(name, library, loaded.request.files_root.resolve())
        for library, definitions in loaded.definitions()
        for name in definitions
    }


def _of_request(label: str, loaded: LoadedRequest) -> str:
    return f"{label} of {loaded.request.vlnv}"


def _message(name: MessageName, library: MessageLibrary, folder: Path) -> dict[str, str]:
    origin = library.origin(name)
    # A path relative to the core's folder is the same in every copy of the project.
    if Path(origin).is_absolute() and Path(origin).resolve().is_relative_to(folder):
        origin = os.path.relpath(Path(origin).resolve(), folder)
    return {
        "source": origin,
        "sha256": digest(library.content(name)),
        "signature": signature(name, library.closure(name)),
    }


def _tools() -> dict[str, dict[str, str]]:
    tools = packages(_PACKAGES)
    for program, path in installed_programs():
        package = debian_package(path)
        tools[program] = facts_of(program, path) | ({"package": package} if package else {})
    return dict(sorted(tools.items()))
