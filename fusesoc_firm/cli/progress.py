"""Show what a command does while it takes long: in one line of a terminal, elsewhere in a line every ten seconds.

`FIRM_PROGRESS=no` turns this off, for programs that compare the output.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from types import TracebackType
from typing import Self

from fusesoc_firm.cli.common import print_step

_SWITCH = "FIRM_PROGRESS"
# In seconds: the time before a command shows its progress, then between two lines, and between updates of one line.
_PATIENCE, _BETWEEN_LINES, _BETWEEN_UPDATES = 2.0, 10.0, 0.5


class Progress:
    """The progress of a command within a context; `step` may be called from any thread."""

    def __init__(self, step: str, *, is_shown: bool = True) -> None:
        """Begin with a step."""
        self._step = step
        self._started = time.monotonic()
        self._is_terminal = sys.stderr.isatty()
        self._is_shown = is_shown and os.environ.get(_SWITCH) != "no"
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._show, name="progress", daemon=True)

    def step(self, step: str) -> None:
        """Name the current step."""
        self._step = step

    def say(self, text: str) -> None:
        """Print a text above the progress, whose step is its first line from now on."""
        if self._is_shown and self._is_terminal:
            print_step("")
        print(text, file=sys.stderr, flush=True)
        self.step(text.partition("\n")[0])

    def __enter__(self) -> Self:
        """Begin to show the progress."""
        if self._is_shown:
            self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """Remove the line from the terminal."""
        if self._is_shown:
            self._ended.set()
            self._thread.join()
            if self._is_terminal:
                print_step("")

    def _show(self) -> None:
        pause = _PATIENCE
        while not self._ended.wait(pause):
            seconds = time.monotonic() - self._started
            if self._is_terminal:
                print_step(f"[{seconds:.0f} s] {self._step}")
            else:
                print(f"[{seconds:.0f} s] {self._step}", file=sys.stderr, flush=True)
            pause = _BETWEEN_UPDATES if self._is_terminal else _BETWEEN_LINES
