"""The two ends of an AXI-Stream with frames: a source that sends whole frames, and a sink that collects them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from fusesoc_firm.cocotb.cycles import bits_of, number_of

_BYTE_BITS = 8


class Source:
    """Sends frames on a stream; a pause never takes an offered beat back."""

    def __init__(self, dut: Any, prefix: str, pauses: Callable[[], bool]) -> None:
        self._ports = {name: getattr(dut, f"{prefix}_{name}") for name in ("tdata", "tkeep", "tvalid", "tlast")}
        self._ready = getattr(dut, f"{prefix}_tready")
        self._lanes = len(self._ports["tkeep"])
        self._pauses = pauses
        self._beats: deque[tuple[bytes, bool]] = deque()
        self._is_offered = self._is_taken = False

    def send(self, frame: bytes) -> None:
        """Send a frame after the earlier ones."""
        parts = [frame[start : start + self._lanes] for start in range(0, len(frame), self._lanes)]
        self._beats += [(part, number == len(parts)) for number, part in enumerate(parts, start=1)]

    def drive(self) -> None:
        """Offer the next beat, or pause."""
        if self._is_taken:
            self._beats.popleft()
            self._is_offered = False
        self._is_offered = self._is_offered or bool(self._beats and not self._pauses())
        self._ports["tvalid"].value = int(self._is_offered)
        if self._is_offered:
            data, is_last = self._beats[0]
            self._ports["tdata"].value = int.from_bytes(data, "little")
            self._ports["tkeep"].value = (1 << len(data)) - 1
            self._ports["tlast"].value = int(is_last)

    def sample(self) -> None:
        """See whether the beat is taken."""
        self._is_taken = self._is_offered and bool(number_of(self._ready))


class Sink:
    """Collects frames from a stream; `frames` are the whole ones, in order."""

    def __init__(self, dut: Any, prefix: str, pauses: Callable[[], bool]) -> None:
        self._ports = {
            name: getattr(dut, f"{prefix}_{name}") for name in ("tdata", "tkeep", "tuser", "tvalid", "tlast")
        }
        self._ready = getattr(dut, f"{prefix}_tready")
        self._pauses = pauses
        self._frame = bytearray()
        self._is_ready = False
        self.frames: deque[bytes] = deque()
        self.aborted = 0

    def drive(self) -> None:
        """Be ready, or pause."""
        self._is_ready = not self._pauses()
        self._ready.value = int(self._is_ready)

    def sample(self) -> None:
        """Take a beat."""
        if not self._is_ready or not number_of(self._ports["tvalid"]):
            return
        data, keep = bits_of(self._ports["tdata"]), number_of(self._ports["tkeep"])
        for lane in range(len(self._ports["tkeep"])):
            if keep >> lane & 1:
                end = len(data) - _BYTE_BITS * lane
                byte = data[end - _BYTE_BITS : end]
                if set(byte) - {"0", "1"}:
                    raise AssertionError(f"byte {len(self._frame)} of a frame is undefined: {byte}")
                self._frame.append(int(byte, 2))
        if number_of(self._ports["tlast"]):
            if number_of(self._ports["tuser"]):
                self.aborted += 1
            else:
                self.frames.append(bytes(self._frame))
            self._frame.clear()
