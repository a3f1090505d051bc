"""A serial line between a program in an emulator and the pins of a simulated system.

The emulator's UART is a socket that carries bytes; the simulator's bench turns them into bits at the pins of
`interconnect: uart`, and back (`+RAW=true` of cores/sim/rtl/firm_sim_link.v).
"""

from __future__ import annotations

import select
import socket
import threading
from pathlib import Path

from fusesoc_firm.node.transport.simulator import Simulator, Taken
from fusesoc_firm.node.transport.transport import Burst, Closing, TransportError

# The system takes this many bytes at once from the emulator, whose UART waits meanwhile.
_MOST_BYTES = 64
_STEP_CYCLES = 5_000
# Without a beat for this time, nothing is under way in the hardware, and the simulator rests.
_REST_CYCLES = 100_000
_REST_SECONDS = 0.02


class Line(Closing):
    """The line, which a thread of its own serves until it is closed.

    `error` is what ended it unasked. `moved` counts the bytes in both directions. `is_at_rest` if nothing has moved at
    the pins for a while, as before the emulator starts.
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
        self._waiting = 0  # requests that the system has not taken
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
        while not self._is_closed:
            self.is_at_rest = not self._waiting and self._simulator.quiet >= _REST_CYCLES
            if not self._waiting and _is_readable(peer, _REST_SECONDS if self.is_at_rest else 0):
                data = peer.recv(_MOST_BYTES)
                if not data:
                    return
                self.is_at_rest = False
                self._simulator.request(data)
                self._waiting += 1
                self.moved += len(data)
            for event in self._simulator.run(_STEP_CYCLES):
                if isinstance(event, Taken):
                    self._waiting -= 1
                elif isinstance(event, Burst):
                    peer.sendall(event.data)
                    self.moved += len(event.data)


def _is_readable(item: socket.socket, seconds: float) -> bool:
    return bool(select.select([item], [], [], seconds)[0])
