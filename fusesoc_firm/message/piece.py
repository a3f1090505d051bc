"""Text that knows its place: every part the parser cuts out of a line can be pointed at in an error."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from fusesoc_firm.text.diagnostics import SourceRef

_BYTE_ORDER_MARK = "\ufeff"
# Not str.splitlines(): a form feed or U+2028 in a comment ends no line in any editor.
_LINE_END = re.compile(r"\r\n|\n|\r")
_BLANKS = re.compile(r"\s+")


@dataclass(frozen=True)
class Piece:
    """The characters `start` to `end` (exclusive, from 0) of the line `line_text`, which is number `line` of `file`."""

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
        """The place, for an error or for the model."""
        return SourceRef(self.file, self.line, self.start + 1, self.line_text, max(1, self.end - self.start))

    def part(self, start: int, end: int | None = None) -> Piece:
        """The characters `start` to `end` of this piece, counted from its start."""
        stop = self.end if end is None else self.start + end
        return Piece(self.file, self.line, self.line_text, self.start + start, stop)

    def strip(self) -> Piece:
        """The piece without the blanks at its ends."""
        start = len(self.text) - len(self.text.lstrip())
        return self.part(start, max(start, len(self.text.rstrip())))

    def partition(self, separator: str) -> tuple[Piece, Piece]:
        """What stands before and behind the first `separator`, stripped; without one, everything stands before it."""
        before, found, _ = self.text.partition(separator)
        return self.part(0, len(before)).strip(), self.part(len(before) + len(found)).strip()

    def split_word(self) -> tuple[Piece, Piece]:
        """The first word and the rest, stripped."""
        blanks = _BLANKS.search(self.text)
        return self.partition(blanks.group()) if blanks else (self, self.part(len(self.text)))


def read_lines(text: str, file: str) -> Iterator[Piece]:
    """The lines of a text without line ends and byte order mark, numbered from 1."""
    for number, line in enumerate(_LINE_END.split(text.removeprefix(_BYTE_ORDER_MARK)), start=1):
        yield Piece(file, number, line, 0, len(line))
