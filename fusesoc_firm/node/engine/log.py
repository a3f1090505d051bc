"""The lines of a node for its user, which go to the terminal and to ROS's log, the topic `/rosout`.

log = Log(print)
log.warn("the hardware rejected a message")       # before, during and after the connection to ROS
log.connect(carrier.log)
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from enum import IntEnum

# The number of lines before a connection that ROS's log gets, too.
_MOST_EARLIER = 50


class Level(IntEnum):
    """The severity of a line, by the numbers of ROS 2 and of Python's `logging`."""

    INFO = 20
    WARNING = 30
    ERROR = 40


class Log:
    """Prints lines and passes them on; any thread may call its methods."""

    def __init__(self, say: Callable[[str], None]) -> None:
        """Begin without a connection; `say` prints a line."""
        self._say = say
        self._lock = threading.Lock()
        self._lines: deque[tuple[Level, str]] = deque(maxlen=_MOST_EARLIER)
        self._takers: list[Callable[[Level, str], None]] = []

    def connect(self, take: Callable[[Level, str], None]) -> None:
        """Pass the lines so far and all further ones to a log of ROS."""
        with self._lock:
            for level, text in self._lines:
                take(level, text)
            self._takers.append(take)

    def info(self, text: str) -> None:
        """Print a line about the normal work of the node, and pass it on."""
        self._say(text)
        self.pass_on(Level.INFO, text)

    def warn(self, text: str) -> None:
        """Print a line about a fault after which the node continues, and pass it on."""
        self._say(text)
        self.pass_on(Level.WARNING, text)

    def pass_on(self, level: Level, text: str) -> None:
        """Pass on a line that is printed elsewhere."""
        with self._lock:
            self._lines.append((level, text))
            for take in self._takers:
                take(level, text)
