"""The store of steps' results: one record for each action, and the contents of outputs by their SHA-256.

    <root>/actions1/ac/<first two digits>/<key>        a record, as JSON after its own SHA-256
    <root>/actions1/cas/<first two digits>/<digest>    the content of an output or a log
    <root>/actions1/notes/<first two digits>/<key>     plain data about a plan or a setup of FuseSoC, like a record

The folders are those that remote caches of build tools use. The store has a size limit of its own, since binaries and
bitstreams would push out generated cores. As in the store of generated cores, nothing that is read is trusted: a record
of another form and a content with another digest count as missing.
"""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.action.contents import Contents
from fusesoc_firm.action.observed import Fact
from fusesoc_firm.action.tree import FILE, FOLDER, LINK, PROGRAM, Item
from fusesoc_firm.store import layout, shared_files
from fusesoc_firm.store.layout import digest, is_digest, is_path
from fusesoc_firm.store.store import parse_size
from fusesoc_firm.text.diagnostics import fail

FOLDER_NAME = "actions1"
LIMIT = "FUSESOC_FIRM_ACTIONS_SIZE"
_AC, _CAS, _NOTES = f"{FOLDER_NAME}/ac", f"{FOLDER_NAME}/cas", f"{FOLDER_NAME}/notes"
_DEFAULT_LIMIT = "10G"
_KEPT_OF_LIMIT = 0.8
_MOST_BYTES = 2**31
_MOST_RECORD_BYTES = 2**26
_FACT_PARTS, _ITEM_PARTS = 3, 4


@dataclass(frozen=True)
class Record:
    """The result of a step that succeeded.

    `outputs` are the new and changed items in the order of their times, `removed` the removed paths, `log` the digest
    of the output and `seconds` the duration. `place` is the folder of the step if an output contains its path, else
    empty.
    """

    facts: tuple[Fact, ...]
    outputs: Mapping[str, Item]
    removed: tuple[str, ...]
    log: str
    seconds: float
    place: str = ""


@dataclass(frozen=True)
class Results:
    """The store of results in the folder `root`, of at most about `limit` bytes."""

    root: Path
    limit: int

    def contents(self) -> Contents:
        """Return the digests of files that this user's runs share."""
        return Contents(self.root / FOLDER_NAME / f"contents-{os.getuid()}.json")

    def record(self, key: str) -> Record | None:
        """Return the record of an action, or None if it is missing or damaged."""
        try:
            return _record(self._plain(_place(_AC, key)))
        except (ValueError, TypeError, LookupError):
            return None

    def note(self, key: str) -> object:
        """Return the plain data of a note, or None if it is missing or damaged."""
        return self._plain(_place(_NOTES, key))

    def keep_note(self, key: str, data: object) -> None:
        """Store a note, if the store can be written."""
        with suppress(OSError):
            self._keep_plain(_place(_NOTES, key), data)

    def content(self, name: str) -> bytes | None:
        """Return the content with this digest, or None if it is missing or damaged."""
        data = shared_files.read(str(self.root), _place(_CAS, name), _MOST_BYTES)
        if data is None or digest(data) != name:
            return None
        layout.mark_used(str(self.root), _place(_CAS, name))
        return data

    def keep_record(self, key: str, record: Record) -> None:
        """Store the record of an action, whose contents are already stored. May raise `OSError`."""
        plain = {
            "facts": record.facts,
            "outputs": [[path, item.kind, item.digest, item.identity] for path, item in record.outputs.items()],
            "removed": record.removed,
            "log": record.log,
            "seconds": record.seconds,
            "place": record.place,
        }
        self._keep_plain(_place(_AC, key), plain)

    def keep_content(self, data: bytes) -> str:
        """Store a content and return its digest. May raise `OSError`."""
        name = digest(data)
        if shared_files.state(str(self.root), _place(_CAS, name)) is None or self.content(name) is None:
            shared_files.write_whole(str(self.root), _place(_CAS, name), data)
        return name

    def restore(self, folder: Path, items: Mapping[str, Item]) -> bool:
        """Write items to a folder in their order; return False if a content is missing, and write no further items.

        Files that have the right content are not written. May raise `OSError`.
        """
        contents = Contents()
        return all(self._restore(folder / path, item, contents) for path, item in items.items())

    def size(self) -> int:
        """Return the number of bytes in the store."""
        return sum(size for _, size, _ in self._files())

    def shrink(self, limit: int) -> int:
        """Remove the least recently used files until at most `limit` bytes remain; return the number of removed bytes.

        May raise `OSError`.
        """
        total = removed = 0
        for name, size, _ in self._files():
            total += size
            if total > limit:
                removed += shared_files.remove(str(self.root), name)
        return removed

    def shrink_if_needed(self) -> None:
        """Remove the least recently used files if the store exceeds its limit."""
        with suppress(OSError):
            if self.size() > self.limit:
                self.shrink(int(self.limit * _KEPT_OF_LIMIT))

    def clean(self) -> int:
        """Remove all results; return the number of removed bytes. May raise `OSError`."""
        return shared_files.remove(str(self.root), FOLDER_NAME)

    def _plain(self, name: str) -> object:
        data = shared_files.read(str(self.root), name, _MOST_RECORD_BYTES)
        said, _, text = (data or b"").partition(b"\n")
        if data is None or digest(text).encode() != said:
            return None
        layout.mark_used(str(self.root), name)
        try:
            return json.loads(text)
        except (ValueError, RecursionError):
            return None

    def _keep_plain(self, name: str, data: object) -> None:
        text = json.dumps(data).encode()
        shared_files.write_whole(str(self.root), name, digest(text).encode() + b"\n" + text)

    def _restore(self, path: Path, item: Item, contents: Contents) -> bool:
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
            data = self.content(item.digest)
            if data is None:
                return False
            path.parent.mkdir(parents=True, exist_ok=True)
            # A link is replaced, not followed.
            path.unlink(missing_ok=True)
            path.write_bytes(data)
        path.chmod(0o755 if item.kind == PROGRAM else 0o644)
        return True

    def _files(self) -> list[tuple[str, int, float]]:
        """Return the name, the size and the time of last use of each file, the most recently used first."""
        found = [
            (name, status.st_size, status.st_mtime)
            for part in (_AC, _CAS, _NOTES)
            for name, status in shared_files.listed(str(self.root), part)
            if stat.S_ISREG(status.st_mode)
        ]
        return sorted(found, key=lambda file: (-file[2], file[0]))


def default_results(environment: Mapping[str, str] = os.environ) -> Results:
    """Return the store that the environment variables select. Raise `InputError` if the limit is not a size."""
    limit = environment.get(LIMIT) or _DEFAULT_LIMIT
    if (size := parse_size(limit)) is None:
        fail(f"{LIMIT} is '{limit}', which is not a size", hint="legal: a number of bytes, such as 500M or 20G")
    return Results(Path(layout.default_root(environment)), size)


def _place(part: str, name: str) -> str:
    return f"{part}/{name[:2]}/{name}"


def _record(data: object) -> Record | None:
    """Return the record in plain data, or None if the data have another form."""
    if not isinstance(data, dict):
        return None
    facts, outputs, removed = data["facts"], data["outputs"], data["removed"]
    is_good = (
        all(len(fact) == _FACT_PARTS and isinstance(fact[0], str) and isinstance(fact[1], str) for fact in facts)
        and all(_is_item(item) for item in outputs)
        and all(is_path(path) for path in removed)
        and is_digest(data["log"])
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
    return Record(facts, items, tuple(removed), data["log"], float(data["seconds"]), data["place"])


def _is_item(item: object) -> bool:
    if not isinstance(item, list) or len(item) != _ITEM_PARTS or not is_path(item[0]):
        return False
    _, kind, name, identity = item
    if identity and not is_digest(identity):
        return False
    if kind in (FILE, PROGRAM):
        return is_digest(name)
    return (kind == FOLDER and name == "") or (kind == LINK and isinstance(name, str) and "\0" not in name)
