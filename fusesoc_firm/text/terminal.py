"""Keep the codes that control a terminal out of what a command prints: names and texts come from others."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO

# Control characters, those that reverse the direction of text, and lone surrogates, which no stream encodes.
_CONTROL = r"\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff"
_UNSAFE = re.compile(f"[{_CONTROL}]")
# Our own codes: green, red, the end of a colour, and the end of a line of progress.
_UNSAFE_ON_TERMINAL = re.compile(rf"(?!\x1b\[(?:3[12]m|0m|K))[{_CONTROL}]")


def safe(text: str) -> str:
    """Return a text in which these characters are escaped as in Python."""
    return _UNSAFE.sub(_escaped, text)


@contextmanager
def safe_output() -> Iterator[None]:
    """Escape such characters in all that is written to `sys.stdout` and `sys.stderr` within this context."""
    streams = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = map(_SafeStream, streams)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = streams


def _escaped(found: re.Match[str]) -> str:
    return repr(found[0])[1:-1]


class _SafeStream:
    """A stream with the escapes; the codes of our own colours remain on a terminal."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._unsafe = _UNSAFE_ON_TERMINAL if stream.isatty() else _UNSAFE

    def write(self, text: str) -> int:
        self._stream.write(self._unsafe.sub(_escaped, text))
        return len(text)

    def writelines(self, lines: list[str]) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)
