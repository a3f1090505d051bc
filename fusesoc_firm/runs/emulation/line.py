"""A serial line between a program in an emulator and the pins of a simulated system.

The emulator's UART is a socket that carries bytes; the simulator's bench converts them to bits at the pins of
`interconnect: uart`, and back (`+RAW=true` of cores/sim/rtl/firm_sim_link.v).
"""

from __future__ import annotations

import select
import socket
import threading
from contextlib import suppress
from pathlib import Path

from fusesoc_firm.node.transport.simulator import Simulator, Taken
from fusesoc_firm.node.transport.transport import Burst, Closing, TransportError

# The system accepts at most this many bytes at once from the emulator, whose UART waits meanwhile.
_MOST_BYTES = 64
# With this many pending bytes for the emulator, the simulation waits. The program still sends: if the line also stopped
# reading, both sides would wait for each other forever.
_MOST_PENDING = 1 << 20
_STEP_CYCLES = 5_000
# After this time without a beat, the hardware is idle, and the simulator pauses.
_REST_CYCLES = 100_000
_REST_SECONDS = 0.02


class Line(Closing):
    """The line, which a separate thread serves until it is closed.

    `error` is the reason for an unexpected end. `moved` counts the bytes in both directions. `is_at_rest` is set while
    the pins are idle, also before the emulator starts.
    """

    def __init__(self, simulator: Simulator, path: Path) -> None:
        """Listen for the emulator at a socket of this path."""
        self.error = ""
        self.moved = 0
        self._simulator = simulator
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(str(path))
        self._listener.listen(1)
        self._is_closed = False
        self._waiting = 0  # requests that the system has not accepted
        self._pending = bytearray()  # bytes that the emulator has not accepted
        self.is_at_rest = True
        self._thread = threading.Thread(target=self._serve, name="line", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the simulation. A second call does nothing."""
        self._is_closed = True
        self._thread.join()
        self._listener.close()
        self._simulator.close()

    def _serve(self) -> None:
        try:
            while not (self._is_closed or _is_readable(self._listener, _REST_SECONDS)):
                pass
            if not self._is_closed:
                peer, _ = self._listener.accept()
                with peer:
                    self._carry(peer)
        except (TransportError, OSError) as error:
            self.error = self.error or str(error)

    def _carry(self, peer: socket.socket) -> None:
        self._simulator.run(1)
        peer.setblocking(False)
        while not self._is_closed:
            is_quiet = self._simulator.quiet >= _REST_CYCLES
            self.is_at_rest = is_quiet and not self._waiting and not self._pending
            if not self._waiting and _is_readable(peer, _REST_SECONDS if self.is_at_rest else 0):
                data = peer.recv(_MOST_BYTES)
                if not data:
                    return
                self.is_at_rest = False
                self._simulator.request(data)
                self._waiting += 1
                self.moved += len(data)
            if len(self._pending) >= _MOST_PENDING:
                select.select([], [peer], [], _REST_SECONDS)
            else:
                self._run()
            self._send(peer)

    def _run(self) -> None:
        for event in self._simulator.run(_STEP_CYCLES):
            if isinstance(event, Taken):
                self._waiting -= 1
            elif isinstance(event, Burst):
                self._pending += event.data

    def _send(self, peer: socket.socket) -> None:
        """Send as many bytes as the emulator accepts now."""
        with suppress(BlockingIOError):
            while self._pending:
                sent = peer.send(self._pending)
                del self._pending[:sent]
                self.moved += sent


def _is_readable(item: socket.socket, seconds: float) -> bool:
    return bool(select.select([item], [], [], seconds)[0])
