"""Makes Ctrl-C work in our commands, however the process was started.

A script's shell makes background commands (`make test &`) ignore SIGINT, and so do some CI runners. All child programs
inherit this setting, and Python keeps it.
"""

from __future__ import annotations

import signal


def accept_interrupts() -> None:
    """Let SIGINT raise `KeyboardInterrupt` even if it was ignored. Programs started afterwards receive it, too.

    Call this at the start of a process, in its main thread.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
