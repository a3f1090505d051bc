"""Report faults in the user's input, with their places and the legal alternatives, and warn of doubtful input.

Every reader of user input (message definitions, specifications, stimuli) reports through a `Diagnostics` collector and
continues as far as possible. The collector then raises one `InputError` with all faults in the file. Only the two entry
points (`cli`, `plugin.answer`) catch this error; they print it and exit with 1. Warnings are only printed and change
neither the output nor the exit status.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

# The maximum number of reported faults; a file of the wrong kind would have a fault on every line.
_MOST_SHOWN = 200
# The maximum number of characters shown around a fault, and the minimum length of a word that is shortened.
_WIDEST = 200
# The maximum number of equally near words in a hint.
_MOST_TWINS = 3
_LONG_WORD = re.compile(r"\S{500,}")


@dataclass(frozen=True)
class SourceRef:
    """A place in a text: `line` and `column` count from 1, `text` is the whole line, `width` is in characters."""

    file: str
    line: int
    column: int
    text: str = ""
    width: int = 1

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"

    def excerpt(self) -> str:
        """Return the line with a caret under the place, or an empty string if the text is unknown."""
        if not self.text:
            return ""
        number = f"{self.line:5d}"
        first = max(0, self.column - _WIDEST // 2) if len(self.text) > _WIDEST else 0
        shown = "".join(c if c.isprintable() or c == "\t" else "?" for c in self.text[first : first + _WIDEST])
        # Only repeated tabs keep the caret aligned.
        indent = "".join("\t" if c == "\t" else " " for c in shown[: self.column - 1 - first])
        underline = "^" + "~" * (min(self.width, max(1, len(shown) - len(indent))) - 1)
        return f"{number} | {shown}\n{' ' * len(number)} | {indent}{underline}"


def byte_place(file: str, data: bytes, position: int) -> SourceRef:
    """Return the place of a byte in a binary file; its column is counted in bytes."""
    line_start = data.rfind(b"\n", 0, position) + 1
    return SourceRef(file, data.count(b"\n", 0, position) + 1, position - line_start + 1)


@dataclass(frozen=True)
class Diagnostic:
    """A fault or a warning: a sentence, a place (None for input without lines) and, if known, the legal values."""

    message: str
    source: SourceRef | None = None
    hint: str = ""
    is_warning: bool = False

    def __str__(self) -> str:
        place = f"{self.source}: " if self.source else ""
        lines = [f"{place}{'warning' if self.is_warning else 'error'}: {_readable(self.message)}"]
        if self.source and (excerpt := self.source.excerpt()):
            lines.append(excerpt)
        if self.hint:
            lines.append(f"      = {_readable(self.hint)}")
        return "\n".join(lines)

    def data(self) -> dict[str, str | int]:
        """Return the fault or warning as plain data: severity, message and, if known, file, line, column and hint."""
        severity = "warning" if self.is_warning else "error"
        found: dict[str, str | int] = {"severity": severity, "message": _readable(self.message)}
        if self.source:
            found |= {"file": self.source.file, "line": self.source.line, "column": self.source.column}
        return found | ({"hint": _readable(self.hint)} if self.hint else {})


def _readable(text: str) -> str:
    """Return `text` for a terminal: control characters are escaped, and very long words are shortened."""
    escaped = "".join(c if c.isprintable() or c in "\t\n" else repr(c)[1:-1] for c in text)
    return _LONG_WORD.sub(lambda word: f"{word[0][:100]}...{word[0][-20:]}", escaped)


class InputError(Exception):
    """All faults in an input; `str()` returns the text to print."""

    def __init__(self, diagnostics: Iterable[Diagnostic]) -> None:
        self.diagnostics = tuple(diagnostics)
        lines = map(str, self.diagnostics[:_MOST_SHOWN])
        super().__init__("\n".join([*lines, *([self._rest()] if self._rest() else [])]))

    def shown(self) -> Sequence[Diagnostic]:
        """Return the faults to show, the last of which may be the number of further ones."""
        rest = [Diagnostic(self._rest())] if self._rest() else []
        return *self.diagnostics[:_MOST_SHOWN], *rest

    def _rest(self) -> str:
        return f"and {len(self.diagnostics) - _MOST_SHOWN} more" if len(self.diagnostics) > _MOST_SHOWN else ""


@dataclass
class Diagnostics:
    """A collector of faults, so that a user sees all faults together."""

    found: list[Diagnostic] = field(default_factory=list)
    warned: list[Diagnostic] = field(default_factory=list)
    _known: set[Diagnostic] = field(default_factory=set, repr=False)

    def error(self, message: str, source: SourceRef | None = None, hint: str = "") -> None:
        """Add a fault; duplicates at the same place are dropped."""
        diagnostic = Diagnostic(message, source, hint)
        if diagnostic not in self._known:
            self._known.add(diagnostic)
            self.found.append(diagnostic)

    def warn(self, message: str, source: SourceRef | None = None, hint: str = "") -> None:
        """Add a warning about input that is legal but probably unintended."""
        self.warned.append(Diagnostic(message, source, hint, is_warning=True))

    @property
    def warnings(self) -> tuple[Diagnostic, ...]:
        """All warnings, in the order of files, lines and columns."""
        return tuple(sorted(self.warned, key=_position))

    def take(self, error: InputError, source: SourceRef | None) -> None:
        """Add another reader's faults; `source`, the place that caused that reader's run, replaces a missing place."""
        for fault in error.diagnostics:
            self.error(fault.message, fault.source or source, fault.hint)

    @contextmanager
    def noting(self, source: SourceRef | None = None) -> Iterator[None]:
        """Add the faults that end this context, with `source` as in `take`."""
        try:
            yield
        except InputError as error:
            self.take(error, source)

    def raise_if_any(self) -> None:
        """Raise `InputError` with every fault, in the order of files, lines and columns."""
        if self.found:
            raise InputError(sorted(self.found, key=_position))


def _position(diagnostic: Diagnostic) -> tuple[str, int, int]:
    source = diagnostic.source
    return (source.file, source.line, source.column) if source else ("", 0, 0)


def fail(message: str, source: SourceRef | None = None, hint: str = "") -> NoReturn:
    """Raise an `InputError` with a single fault that prevents further checks."""
    raise InputError([Diagnostic(message, source, hint)])


def nearest(word: str, choices: Iterable[str]) -> str:
    """Return a hint for an unknown word: the nearest legal word, or all legal words if none is similar.

    If a few words differ from it in one letter, all of them are the nearest.
    """
    legal = sorted(set(choices))
    if 1 < len(twins := [item for item in legal if _is_twin(word, item)]) <= _MOST_TWINS:
        return "did you mean '" + "' or '".join(twins) + "'?"
    if near := closest(word, legal):
        return f"did you mean '{near}'?"
    if not legal:
        return ""
    shown = ", ".join(legal[:20]) + (", ..." if len(legal) > 20 else "")
    return f"legal here: {shown}"


def _is_twin(word: str, other: str) -> bool:
    """Return whether two words differ in one letter."""
    return len(word) == len(other) > 1 and sum(a != b for a, b in zip(word.lower(), other.lower(), strict=True)) == 1


def nearest_file(path: Path) -> str:
    """Return a hint for a missing file: its missing folder, a file of its name one folder below, or the nearest one.

    Without a near file, it names all files of its kind.
    """
    if not path.parent.is_dir():
        return f"there is no folder {path.parent}"
    if below := sorted(path.parent.glob(f"*/{path.name}")):
        return f"did you mean '{below[0]}'?"
    names = [item.name for item in path.parent.iterdir() if item.is_file()]
    near = closest(path.name, names)
    return nearest(path.name, [near] if near else [name for name in names if name.endswith(path.suffix)])


def closest(word: str, choices: Iterable[str], similarity: float = 0.6) -> str | None:
    """Return the word that was probably meant, regardless of case, or None if none has this similarity, of 0 to 1."""
    lowered = {choice.lower(): choice for choice in sorted(set(choices))}
    # Swapped letters are nearer than a missing letter: `clocsk` is `clocks`, not `clock`.
    close = [choice for choice in lowered if sorted(choice) == sorted(word.lower())]
    close = close or difflib.get_close_matches(word.lower(), lowered, n=1, cutoff=similarity)
    return lowered[close[0]] if close else None
