"""A specification that is open in the page: its text, which follows the file, and the history of its edits."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from io import FileIO
from pathlib import Path
from time import monotonic
from typing import Any

from fusesoc_firm.studio.edits import edited
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.files import read_regular, replace_content
from fusesoc_firm.text.yaml_edit import EditError
from fusesoc_firm.text.yaml_text import SMALL

_BYTE_ORDER_MARK = "\ufeff"
_CHANGED = "the file has changed meanwhile"
_LATE_SECONDS = 2.0
# The number of edits that can be undone.
_MOST_STEPS = 1000


@dataclass(frozen=True)
class _Former:
    """The file that an edit of the page has replaced, with its content.

    An editor that was opening it saves to it still, until about the time `end`.
    """

    file: FileIO
    content: bytes
    end: float = field(default_factory=lambda: monotonic() + _LATE_SECONDS)


class Document:
    """A file and its former texts; a change of the file by another program clears the history."""

    def __init__(self, path: Path) -> None:
        """Read the file; raise `InputError` if that is not possible."""
        self.path = path
        self.text = ""
        self._mark = ""
        self._former: _Former | None = None
        self._undone: list[str] = []
        self._done: list[str] = []
        self.follow()

    @property
    def version(self) -> str:
        """The version of the text: a digest."""
        return hashlib.sha256(self.text.encode()).hexdigest()[:16]

    @property
    def can_undo(self) -> bool:
        """Whether an edit can be undone."""
        return bool(self._done)

    @property
    def can_redo(self) -> bool:
        """Whether an undone edit can be repeated."""
        return bool(self._undone)

    def follow(self) -> bool:
        """Read the file, and return whether its text differs. May raise `InputError`.

        Times do not tell whether it does: two changes can have the same time.
        """
        self._recover()
        try:
            text = read_regular(self.path, SMALL.bytes).decode()
        except OSError as error:
            fail(f"cannot read {self.path}: {error.strerror}")
        except UnicodeDecodeError:
            fail(f"cannot read {self.path}: it is not UTF-8")
        self._mark = _BYTE_ORDER_MARK if text.startswith(_BYTE_ORDER_MARK) else ""
        text = text.removeprefix(_BYTE_ORDER_MARK)
        if text == self.text:
            return False
        self.text = text
        self._done, self._undone = [], []
        return True

    def edit(self, version: str, edit: Mapping[str, Any]) -> None:
        """Make an edit of the text with this version; raise `EditError` if it cannot be made."""
        self._check(version)
        self._replace(edited(self.text, edit))

    def write(self, version: str, text: str) -> None:
        """Replace the whole text, as an editor does; raise `EditError` if the version has changed."""
        self._check(version)
        self._replace(text)

    def undo(self, version: str) -> None:
        """Undo the last edit."""
        self._check(version)
        self._step(self._done, self._undone, "undo")

    def redo(self, version: str) -> None:
        """Repeat the edit that was undone last."""
        self._check(version)
        self._step(self._undone, self._done, "redo")

    def _step(self, source: list[str], sink: list[str], what: str) -> None:
        if not source:
            raise EditError(f"there is nothing to {what}")
        before = self.text
        self._save(source[-1])
        source.pop()
        sink.append(before)

    def _replace(self, text: str) -> None:
        before = self.text
        if text == before:
            return
        self._save(text)
        self._done = [*self._done[-_MOST_STEPS + 1 :], before]
        self._undone = []

    def _check(self, version: str) -> None:
        self.follow()
        if version != self.version:
            raise EditError(_CHANGED)

    def _save(self, text: str) -> None:
        before, data = (self._mark + self.text).encode(), (self._mark + text).encode()
        if len(data) > SMALL.bytes:
            raise EditError(f"a specification has at most {SMALL.bytes} bytes")
        self._recover()
        try:
            former = _Former(self.path.open("rb", buffering=0), before)
            is_written = self._replaced(before, data)
        except OSError as error:
            raise EditError(f"cannot write {self.path}: {error.strerror}") from error
        if not is_written:
            former.file.close()
            raise EditError(_CHANGED)
        self._forget()
        self.text, self._former = text, former

    def _replaced(self, before: bytes, data: bytes) -> bool:
        # For a link, its target is replaced.
        return replace_content(os.path.realpath(self.path), before, data)

    def _recover(self) -> None:
        """Put back what an editor has saved to the replaced file, which it had opened before."""
        if not self._former:
            return
        self._former.file.seek(0)
        found = self._former.file.read(SMALL.bytes) or b""
        # The file is empty while an editor saves it.
        if found and found != self._former.content:
            with suppress(OSError):
                self._replaced((self._mark + self.text).encode(), found)
            self._former = replace(self._former, content=found)
        elif monotonic() > self._former.end:
            self._forget()

    def _forget(self) -> None:
        if self._former:
            self._former.file.close()
            self._former = None
