"""The command `firm`, also as `python -m fusesoc_firm`; Ctrl-C ends it without a traceback while it is imported."""

from __future__ import annotations

import os
import signal
import sys

_INTERRUPTED = 130


def main() -> int:
    """Run `firm`; return its exit status."""
    signal.signal(signal.SIGINT, _leave)
    from fusesoc_firm.cli import main as run

    signal.signal(signal.SIGINT, signal.default_int_handler)
    return run()


def _leave(*_: object) -> None:
    """End at once: an exception within an import could become another one."""
    os.write(2, b"interrupted\n")
    os._exit(_INTERRUPTED)


if __name__ == "__main__":
    sys.exit(main())
