"""Accesses to the status of hardware whose transport a node uses, beside the node's messages.

The node's sender sends the requests, and its receiver passes on the answers.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from queue import Empty, SimpleQueue

from fusesoc_firm.node.transport.transport import TransportError
from fusesoc_firm.system.status_frames import answered

# Hardware without a status drops the request as a frame with an unknown id.
# Shorter than the time that `access` of node/status/status.py waits for the node.
ANSWER_SECONDS = 5.0
NO_ANSWER = "the hardware did not answer: it has no status, or is stalled"


class StatusExchange:
    """One access at a time, by any thread; `send` passes a request to the node's sender."""

    def __init__(self, send: Callable[[bytes], None]) -> None:
        self._send = send
        self._turn = threading.Lock()
        self._answers: SimpleQueue[bytes] = SimpleQueue()

    def access(self, request: bytes, seconds: float = ANSWER_SECONDS) -> bytes:
        """Return the answer to a request. Raise `TransportError` after this time without an answer."""
        asked = answered(request)
        if asked is None:
            raise TransportError("the frame is not a request of the status")
        end = time.monotonic() + seconds
        if not self._turn.acquire(timeout=seconds):
            raise TransportError(NO_ANSWER)
        try:
            self._answers = SimpleQueue()
            self._send(request)
            while True:
                frame = self._answers.get(timeout=max(0.0, end - time.monotonic()))
                # The answer to an earlier request may arrive late.
                if (answer := answered(frame)) and answer[0] == asked[0]:
                    return frame
        except Empty:
            raise TransportError(NO_ANSWER) from None
        finally:
            self._turn.release()

    def take(self, frame: bytes) -> bool:
        """Take a frame from the hardware if it is an answer; return whether it is."""
        is_answer = answered(frame) is not None
        if is_answer:
            self._answers.put(frame)
        return is_answer
