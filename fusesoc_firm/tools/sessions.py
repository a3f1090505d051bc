"""A program as the leader of a session: its lines as they appear, and its end with all that it has started."""

from __future__ import annotations

import asyncio
import os
import signal
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

# The seconds in which a cancelled program and those that it has started may end by themselves.
_GRACE = 3.0
_CHUNK = 2**16


async def run(command: Sequence[str], folder: Path, take: Callable[[str], None]) -> int:
    """Run a program in a folder, call `take` for each line of its output, and return its exit status.

    A cancelled call ends the program and all programs that it has started.
    """
    process = await _started(command, folder)
    assert process.stdout
    try:
        rest = b""
        while chunk := await process.stdout.read(_CHUNK):
            *lines, rest = (rest + chunk).split(b"\n")
            for line in lines:
                take(line.decode(errors="replace"))
        if rest:
            take(rest.decode(errors="replace"))
        return await process.wait()
    except BaseException:
        await _end(process)
        raise


async def _started(command: Sequence[str], folder: Path) -> asyncio.subprocess.Process:
    """Start a program as the leader of a session; a cancelled call ends what that session has by then."""
    starting = asyncio.create_task(
        asyncio.create_subprocess_exec(
            *command,
            cwd=folder,
            # The launcher of our own builds would answer the steps from its cache.
            env={name: value for name, value in os.environ.items() if name != "EDALIZE_LAUNCHER"},
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.STDOUT,
            start_new_session=True,
        )
    )
    try:
        # A start that is cancelled would end the program alone, which may have started others.
        return await asyncio.shield(starting)
    except asyncio.CancelledError:
        await _end(await starting)
        raise


async def _end(process: asyncio.subprocess.Process) -> None:
    """End a session: `make` removes what it has half written if it gets the milder signal."""
    end = asyncio.get_running_loop().time() + _GRACE
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGTERM)
        while asyncio.get_running_loop().time() < end:
            os.killpg(process.pid, 0)
            await asyncio.sleep(0.05)
        os.killpg(process.pid, signal.SIGKILL)
    await process.wait()
