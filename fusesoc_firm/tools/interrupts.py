"""Ctrl-C as our commands have it, whatever the process was started with.

A script's shell lets what it starts in the background (`make test &`) ignore SIGINT, and so do some CI runners. Every
program below inherits that, and Python then leaves it so.
"""

from __future__ import annotations

import signal


def accept_interrupts() -> None:
    """Let SIGINT raise `KeyboardInterrupt` where it is ignored. Programs that are started afterwards get it, too.

    For the main thread of a process of our own, when it starts.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
