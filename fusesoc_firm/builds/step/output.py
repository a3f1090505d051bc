"""The lines that the programs of a step print, which still reach the step's log at once."""

from __future__ import annotations

import os
import select
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_READ_BYTES = 65_536
# Longer lines are cut, so that the memory is bounded.
_LONGEST_LINE = 4096
_STREAMS = (1, 2)


@contextmanager
def each_line(see: Callable[[str], None]) -> Iterator[None]:
    """Within this context, call `see` with each line that this process and its programs print, without its end."""
    source, sink = os.pipe()
    ended, end = os.pipe()
    kept = [os.dup(stream) for stream in _STREAMS]
    reader = threading.Thread(target=_copy, args=(source, ended, kept[0], see))
    for stream in _STREAMS:
        os.dup2(sink, stream)
    os.close(sink)
    reader.start()
    try:
        yield
    finally:
        for stream, old in zip(_STREAMS, kept, strict=True):
            os.dup2(old, stream)
        os.close(end)
        reader.join()
        for descriptor in (*kept, source, ended):
            os.close(descriptor)


def _copy(source: int, ended: int, sink: int, see: Callable[[str], None]) -> None:
    """Copy the output and report its lines, until it ends, or until `ended` is closed and nothing is waiting."""
    rest = b""
    while source in select.select([source, ended], [], [])[0] and (data := os.read(source, _READ_BYTES)):
        view = memoryview(data)
        while view:
            view = view[os.write(sink, view) :]
        *lines, rest = (rest + data).split(b"\n")
        for line in lines:
            see(_text(line))
        rest = rest[:_LONGEST_LINE]
    # The last line may have no end.
    if rest:
        see(_text(rest))


def _text(line: bytes) -> str:
    return line[:_LONGEST_LINE].decode(errors="replace").rstrip("\r")
