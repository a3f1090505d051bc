"""A simulator that exchanges bytes on its file descriptors 3 and 4."""

from __future__ import annotations

import fcntl
import os
import subprocess
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, NamedTuple

# Connect the pipes to the descriptors that a simulator expects. A shell cannot copy two-digit descriptors, but it can
# open them by name.
_SHELL = 'exec 3<"$1" 4>"$2"; shift 2; exec "$@"'
# The maximum that Linux grants every user. In a small pipe, a large frame requires a process switch for each 64 KiB.
_PIPE_BYTES = 2**20


class Piped(NamedTuple):
    """The process of a simulator, the ends of the pipes to and from it, and the file with what it prints."""

    process: subprocess.Popen[bytes]
    to_simulator: int
    from_simulator: int
    printed: IO[bytes]


def start(command: Sequence[str], folder: Path | None) -> Piped:
    """Start a simulator in `folder`; Ctrl-C does not reach it. May raise `OSError`."""
    printed = tempfile.TemporaryFile()  # noqa: SIM115
    from_us, to_simulator = _pipe()
    from_simulator, to_us = _pipe()
    try:
        process = subprocess.Popen(
            ["/bin/sh", "-c", _SHELL, "sh", f"/dev/fd/{from_us}", f"/dev/fd/{to_us}", *command],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=printed,
            stderr=subprocess.STDOUT,
            pass_fds=(from_us, to_us),
            start_new_session=True,
        )
    except OSError:
        printed.close()
        os.close(to_simulator)
        os.close(from_simulator)
        raise
    finally:
        os.close(from_us)
        os.close(to_us)
    return Piped(process, to_simulator, from_simulator, printed)


def _pipe() -> tuple[int, int]:
    """Return the reading and the writing end of a pipe."""
    ends = os.pipe()
    if hasattr(fcntl, "F_SETPIPE_SZ"):
        # Linux limits the pages of all pipes of a user.
        with suppress(OSError):
            fcntl.fcntl(ends[0], fcntl.F_SETPIPE_SZ, _PIPE_BYTES)
    return ends
