"""Make Ctrl-C work in our commands, regardless of how the process was started.

In scripts, shells start background commands (`make test &`) with SIGINT ignored, as do some CI runners. All child
processes inherit this setting, and Python does not change it.
"""

from __future__ import annotations

import signal


def accept_interrupts() -> None:
    """Let SIGINT raise `KeyboardInterrupt` even if it was ignored; programs started later also receive SIGINT.

    Call this at the start of a process, in its main thread.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
