"""The reference for ROS 1: genpy in a server process (`genpy_server` explains why)."""

from __future__ import annotations

import atexit
import pickle
import shutil
import subprocess
import sys
import threading
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import IO, Any

from fusesoc_firm.frame.codec import MessageValue
from fusesoc_firm.message.middleware import Definitions
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.runs.verify.definitions import NoJudgementError, plain_text

TITLE = "genpy"
_SERVER = Path(__file__).with_name("genpy_server.py")


def is_installed() -> bool:
    """Return whether a known Python on this machine has genpy."""
    return _server() is not None


def version() -> str:
    """Return genpy's version; empty if genpy is not installed."""
    server = _server()
    return server.version if server else ""


def serialise(name: MessageName, definitions: Definitions, values: Sequence[MessageValue]) -> list[bytes]:
    """Return the payload of each value. Raise `NoJudgementError` if genpy rejects the message."""
    server = _server()
    assert server is not None, "ask is_installed() first"
    texts = {str(other): plain_text(definition) for other, definition in definitions.items()}
    is_done, answer = server.ask((str(name), texts, list(values)))
    if not is_done:
        raise NoJudgementError(answer)
    payloads: list[bytes] = answer
    return payloads


class _Server:
    """A running server process. Raises `EOFError` if that Python lacks genpy."""

    def __init__(self, python: str) -> None:
        self._process = subprocess.Popen(
            [python, str(_SERVER)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        assert self._process.stdin is not None and self._process.stdout is not None
        self._requests: IO[bytes] = self._process.stdin
        self._answers: IO[bytes] = self._process.stdout
        self._lock = threading.Lock()
        try:
            self.version: str = pickle.load(self._answers)
        except EOFError:
            self._process.wait()
            raise
        atexit.register(self._end)

    def _end(self) -> None:
        self._requests.close()
        self._process.wait()

    def ask(self, request: object) -> Any:
        with self._lock:
            pickle.dump(request, self._requests, protocol=4)
            self._requests.flush()
            return pickle.load(self._answers)


@cache
def _server() -> _Server | None:
    """Return this process's server, or None without genpy.

    The first Python with genpy (on Debian, the system's) runs the server.
    """
    pythons = dict.fromkeys(filter(None, (sys.executable, shutil.which("python3"), "/usr/bin/python3")))
    for python in pythons:
        try:
            return _Server(python)
        except (OSError, EOFError):
            continue
    return None
