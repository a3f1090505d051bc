"""What the peers of a node in fabric have in common: they speak to a test by lines of JSON.

    python ros_peer.py|cyclone_peer.py RELIABILITY TYPES [listen]

TYPES is `{topic: type}`; the peer publishes on `<topic>_in` and subscribes to `<topic>_out`. Types are `Point`,
`Quaternion`, `String` and `UInt32`. With `listen`, it publishes nothing. The first line on its output is
`{"started": true}`; the second one, `{"matched": seconds}`, says after which time all topics had a match. A line
`[topic, values]` on its input is published, `"graph"` asks for what the peer's graph knows, and `"farewell"` ends it.
What comes is `[topic, values]`. It needs nothing but its own middleware.
"""

from __future__ import annotations

import json
import queue
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, Protocol

FIELDS = {"Point": ["x", "y", "z"], "Quaternion": ["x", "y", "z", "w"], "String": ["data"], "UInt32": ["data"]}
DEPTH = 1000


class Peer(Protocol):
    """A node with a writer and a reader for each topic."""

    def is_matched(self) -> bool: ...
    def write(self, name: str, values: list[Any]) -> None: ...
    def poll(self) -> list[tuple[str, list[Any]]]: ...
    def graph(self) -> dict[str, Any]: ...
    def end(self) -> None: ...


def say(value: object) -> None:
    print(json.dumps(value), flush=True)


def obey(peer: Peer, line: str) -> bool:
    """Do what a line says; whether the peer goes on."""
    command = json.loads(line) if line else "farewell"
    if command == "graph":
        say(peer.graph())
    elif command == "farewell":
        peer.end()
        return False
    else:
        peer.write(*command)
    return True


def run(make: Callable[[dict[str, str], dict[str, str], bool], Peer]) -> None:
    """Run a peer until its input ends or says so."""
    reliability, reads, *others = sys.argv[1:]
    writes = others[0] if others else reads
    peer = make(json.loads(reads), json.loads(writes), reliability == "reliable")
    say({"started": True})
    begun = time.monotonic()
    while not peer.is_matched():
        peer.poll()
    say({"matched": time.monotonic() - begun})
    lines: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(lines,), daemon=True).start()
    goes_on = True
    while goes_on:
        for item in peer.poll():
            say(item)
        while goes_on and not lines.empty():
            goes_on = obey(peer, lines.get())


def _read(lines: queue.SimpleQueue[str]) -> None:
    for line in sys.stdin:
        lines.put(line)
    lines.put("")
