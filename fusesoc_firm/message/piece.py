"""Text with a position, so that an error can refer to any part of a line."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from fusesoc_firm.text.diagnostics import SourceRef

_BYTE_ORDER_MARK = "\ufeff"
# Not `str.splitlines`, which also ends lines at form feeds and U+2028, unlike editors.
_LINE_END = re.compile(r"\r\n|\n|\r")
_BLANKS = re.compile(r"\s+")


@dataclass(frozen=True)
class Piece:
    """The characters `start` to `end` (exclusive, from 0) of `line_text`, which is line `line` of `file`."""

    file: str
    line: int
    line_text: str
    start: int
    end: int

    @property
    def text(self) -> str:
        """The characters themselves."""
        return self.line_text[self.start : self.end]

    @property
    def source(self) -> SourceRef:
        """The source reference, for an error or for the model."""
        return SourceRef(self.file, self.line, self.start + 1, self.line_text, max(1, self.end - self.start))

    def part(self, start: int, end: int | None = None) -> Piece:
        """Return the characters `start` to `end` of this piece, counted from its start."""
        stop = self.end if end is None else self.start + end
        return Piece(self.file, self.line, self.line_text, self.start + start, stop)

    def strip(self) -> Piece:
        """Return the piece without leading or trailing blanks."""
        start = len(self.text) - len(self.text.lstrip())
        return self.part(start, max(start, len(self.text.rstrip())))

    def partition(self, separator: str) -> tuple[Piece, Piece]:
        """Return the stripped parts before and after the first `separator`; without it, the second part is empty."""
        before, found, _ = self.text.partition(separator)
        return self.part(0, len(before)).strip(), self.part(len(before) + len(found)).strip()

    def split_word(self) -> tuple[Piece, Piece]:
        """Return the first word and the stripped rest."""
        blanks = _BLANKS.search(self.text)
        return self.partition(blanks.group()) if blanks else (self, self.part(len(self.text)))


def read_lines(text: str, file: str) -> Iterator[Piece]:
    """Split a text into lines, numbered from 1, without line endings or a byte order mark."""
    for number, line in enumerate(_LINE_END.split(text.removeprefix(_BYTE_ORDER_MARK)), start=1):
        yield Piece(file, number, line, 0, len(line))
