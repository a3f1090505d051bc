"""The store of steps' results: one record for each action, and the contents of outputs by their SHA-256.

    <root>/actions1/ac/<first two digits>/<key>        a record, as JSON after its own SHA-256
    <root>/actions1/cas/<first two digits>/<digest>    the content of an output or a log
    <root>/actions1/notes/<first two digits>/<key>     plain data about a plan or a setup of FuseSoC, like a record

The folders are those that remote caches of build tools use. The store has a separate size limit, since binaries and
bitstreams would push out generated cores. As in the store of generated cores, nothing that is read is trusted: a record
of another form and a content with another digest count as missing.

With a remote store, a result that is missing here is looked up there, and its contents are obtained when they are
needed. New results are written to both. Notes are for one machine.
"""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusesoc_firm.builds.step.contents import Contents
from fusesoc_firm.builds.step.tree import FILE, FOLDER, LINK, PROGRAM, Item
from fusesoc_firm.builds.store import layout, shared_files
from fusesoc_firm.builds.store.layout import is_path
from fusesoc_firm.builds.store.limited import LimitedFolder, limit_of
from fusesoc_firm.builds.store.remote import Remote, remote_store
from fusesoc_firm.tools.digests import default_root, digest, is_digest
from fusesoc_firm.tools.facts import Fact

FOLDER_NAME = "actions1"
LIMIT = "FUSESOC_FIRM_ACTIONS_SIZE"
_AC, _CAS, _NOTES = f"{FOLDER_NAME}/ac", f"{FOLDER_NAME}/cas", f"{FOLDER_NAME}/notes"
_DEFAULT_LIMIT = "10G"
_MOST_BYTES = 2**31
_MOST_RECORD_BYTES = 2**26
_ITEM_PARTS = 4


@dataclass(frozen=True)
class Record:
    """The result of a step that succeeded.

    `outputs` are the new and changed items in the order of their times, `removed` the removed paths, `log` the digest
    of the output and `seconds` the duration. `sizes` are the numbers of bytes of all contents by their digests. `place`
    is the folder of the step if an output contains its path, else empty.
    """

    facts: tuple[Fact, ...]
    outputs: Mapping[str, Item]
    removed: tuple[str, ...]
    log: str
    seconds: float
    sizes: Mapping[str, int]
    place: str = ""


@dataclass(frozen=True)
class Results(LimitedFolder):
    """The store of results, and the remote store."""

    remote: Remote | None = None

    def contents(self) -> Contents:
        """Return the digests of files that this user's runs share."""
        return Contents(self.root / FOLDER_NAME / f"contents-{os.getuid()}.json")

    def record(self, key: str) -> Record | None:
        """Return the record of an action, or None if it is missing or damaged."""
        return _record(self._plain(_place(_AC, key)))

    def remote_record(self, key: str) -> Record | None:
        """Return the record of an action in the remote store, or None if it is missing or damaged."""
        if self.remote is None or (data := self.remote.entry(key)) is None:
            return None
        if (found := _record(layout.parsed(data))) is None:
            self.remote.tell_damage(key)
        return found

    def note(self, key: str) -> object:
        """Return the plain data of a note, or None if it is missing or damaged."""
        return self._plain(_place(_NOTES, key))

    def keep_note(self, key: str, data: object) -> None:
        """Store a note, if the store can be written."""
        with suppress(OSError):
            self._keep_plain(_place(_NOTES, key), data)

    def content(self, name: str) -> bytes | None:
        """Return the content with this digest, or None if it is missing here or damaged."""
        data = shared_files.read(self._root, _place(_CAS, name), _MOST_BYTES)
        if data is None or digest(data) != name:
            return None
        layout.mark_used(self._root, _place(_CAS, name))
        return data

    def content_of(self, record: Record, name: str) -> bytes | None:
        """Return a content of a record, from the remote store if it is missing here, or None."""
        if (data := self.content(name)) is not None or self.remote is None:
            return data
        if (data := self.remote.content(name, record.sizes[name])) is not None:
            with suppress(OSError):
                self.keep_content(data)
        return data

    def keep_record(self, key: str, record: Record) -> None:
        """Store the record of an action, whose contents are already stored. May raise `OSError`."""
        self._keep_plain(_place(_AC, key), _plain(record))

    def send(self, key: str, record: Record) -> bool:
        """Write the record of an action and its contents to the remote store; return whether that succeeded.

        Failures are reported.
        """
        if self.remote is None or not self.remote.is_writable:
            return False
        contents = (self.content(name) for name in record.sizes)
        entry = json.dumps(_plain(record)).encode()
        return self.remote.put_contents(contents) and self.remote.put_entry(key, entry)

    def keep_content(self, data: bytes) -> str:
        """Store a content and return its digest. May raise `OSError`."""
        name = digest(data)
        if shared_files.state(self._root, _place(_CAS, name)) is None or self.content(name) is None:
            shared_files.write_whole(self._root, _place(_CAS, name), data)
        return name

    def restore(self, folder: Path, record: Record) -> bool:
        """Write outputs to a folder in their order; return False if a content is missing, and write no further items.

        Files with the correct content are not written. May raise `OSError`.
        """
        contents = Contents()
        return all(self._restore(folder / path, item, record, contents) for path, item in record.outputs.items())

    def shrink_if_needed(self) -> None:
        """Remove the least recently used files if the store exceeds its limit."""
        with suppress(OSError):
            super().shrink_if_needed()

    def clean(self) -> int:
        """Remove all results; return the number of removed bytes. May raise `OSError`."""
        return shared_files.remove(self._root, FOLDER_NAME)

    def number(self) -> int:
        """Return the number of stored results."""
        return sum(file.name.startswith(f"{_AC}/") for file in self._files())

    def _is_whole(self, name: str, status: os.stat_result) -> bool:
        part, key = name.rpartition("/")[0].rpartition("/")[0], name.rpartition("/")[2]
        if not stat.S_ISREG(status.st_mode) or not is_digest(key) or name != _place(part, key):
            return False
        if part == _CAS:
            return self.content(key) is not None
        return (self.record(key) if part == _AC else self.note(key)) is not None

    def _plain(self, name: str) -> object:
        if (data := layout.read(self._root, name, _MOST_RECORD_BYTES)) is None:
            return None
        layout.mark_used(self._root, name)
        return layout.parsed(data)

    def _keep_plain(self, name: str, data: object) -> None:
        layout.write(self._root, name, json.dumps(data).encode(), _MOST_RECORD_BYTES)

    def _restore(self, path: Path, item: Item, record: Record, contents: Contents) -> bool:
        if item.kind == FOLDER:
            path.mkdir(parents=True, exist_ok=True)
            return True
        if item.kind == LINK:
            if not path.is_symlink() or os.readlink(path) != item.digest:
                path.unlink(missing_ok=True)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.symlink_to(item.digest)
            return True
        if path.is_symlink() or contents.digest(str(path)) != item.digest:
            data = self.content_of(record, item.digest)
            if data is None:
                return False
            path.parent.mkdir(parents=True, exist_ok=True)
            # A link is replaced, not followed.
            path.unlink(missing_ok=True)
            path.write_bytes(data)
        path.chmod(0o755 if item.kind == PROGRAM else 0o644)
        return True

    def _listed(self) -> list[tuple[str, os.stat_result]]:
        return [item for part in (_AC, _CAS, _NOTES) for item in shared_files.listed(self._root, part)]


def default_results(environment: Mapping[str, str] = os.environ) -> Results:
    """Return the store that the environment variables select. Raise `InputError` if the limit is not a size."""
    limit = limit_of(environment, LIMIT, _DEFAULT_LIMIT, "500M or 20G")
    root = default_root(environment)
    return Results(Path(root), limit, remote_store(environment, root))


def _place(part: str, name: str) -> str:
    return f"{part}/{name[:2]}/{name}"


def _plain(record: Record) -> dict[str, object]:
    return {
        "facts": record.facts,
        "outputs": [[path, item.kind, item.digest, item.identity] for path, item in record.outputs.items()],
        "removed": record.removed,
        "log": record.log,
        "seconds": record.seconds,
        "sizes": dict(record.sizes),
        "place": record.place,
    }


def _record(data: object) -> Record | None:
    """Return the record in plain data, or None if the data have another form."""
    try:
        return _checked(data) if isinstance(data, dict) else None
    except (ValueError, TypeError, LookupError, AttributeError):
        return None


def _checked(data: Mapping[str, Any]) -> Record | None:
    """Return the record in plain data, or None. May raise other errors for data of another form."""
    facts, outputs, removed, sizes = data["facts"], data["outputs"], data["removed"], data["sizes"]
    is_good = (
        layout.are_facts(facts)
        and all(_is_item(item) for item in outputs)
        and all(is_path(path) for path in removed)
        and {data["log"], *(item[2] for item in outputs if item[1] in (FILE, PROGRAM))} == sizes.keys()
        and all(is_digest(name) and type(size) is int and size >= 0 for name, size in sizes.items())
        and isinstance(data["seconds"], int | float)
        and isinstance(data["place"], str)
    )
    if not is_good:
        return None
    items = {path: Item(kind, name, identity) for path, kind, name, identity in outputs}
    # No output may be written through a link.
    links = tuple(f"{path}/" for path, item in items.items() if item.kind == LINK)
    if links and any(path.startswith(links) for path in items):
        return None
    facts = tuple((kind, name, state) for kind, name, state in facts)
    return Record(facts, items, tuple(removed), data["log"], float(data["seconds"]), sizes, data["place"])


def _is_item(item: object) -> bool:
    if not isinstance(item, list) or len(item) != _ITEM_PARTS or not is_path(item[0]):
        return False
    _, kind, name, identity = item
    if identity and not is_digest(identity):
        return False
    if kind in (FILE, PROGRAM):
        return is_digest(name)
    return (kind == FOLDER and name == "") or (kind == LINK and isinstance(name, str) and "\0" not in name)
