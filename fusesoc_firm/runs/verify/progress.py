"""Show the progress of a campaign: a bar on a terminal, elsewhere a line after each tenth."""

from __future__ import annotations

import sys
from types import TracebackType

from tqdm import tqdm

from fusesoc_firm.message.model import MessageName


class Progress:
    """The progress of a campaign of `total` messages, of which `done` are done already."""

    def __init__(self, total: int, done: int = 0) -> None:
        """Show nothing yet."""
        self._total = total
        self._done = done
        self._failed = 0
        self._bar = tqdm(total=total, initial=done, unit="msg", disable=None, file=sys.stderr)

    def __enter__(self) -> Progress:
        """Return the progress."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the bar."""
        self._bar.close()

    def note(self, name: MessageName, *, is_failed: bool) -> None:
        """Show that a message is done."""
        self._failed += is_failed
        self._done += 1
        self._bar.set_postfix_str(f"{name}, {self._failed} failed", refresh=False)
        self._bar.update()
        is_tenth = 10 * self._done // self._total > 10 * (self._done - 1) // self._total
        if self._bar.disable and is_tenth:
            print(f"{self._done} of {self._total} messages, {self._failed} failed", file=sys.stderr, flush=True)
