"""The faults of frames: the codes that converters, the Manager and links report in `frame_error_code`.

`make constants` writes `node/c/firm/firm_faults.h`, `node/cpp/firm/faults.hpp` and `cores/axis/rtl/firm_fault_pkg.vhd`.
"""

from __future__ import annotations

from enum import IntEnum


class Fault(IntEnum):
    """A fault of a frame, as a code of four bits; 0 is not a fault."""

    BAD_LENGTH = 1, "the length is not that of the message"
    SHORT_FRAME = 2, "the frame or a part of it ended early"
    LONG_FRAME = 3, "the frame or a part of it continued after its length"
    BAD_ENCODING = 4, "the encoding is unknown"
    BAD_COUNT = 5, "a count exceeds its bound, or a text lacks its terminating zero"
    OVER_BUFFER = 6, "the payload is longer than the publisher's buffer"
    TOO_LONG = 7, "the payload is longer than maxLength"
    BROKEN_BEAT = 8, "a beat is neither full nor the last one, is empty, or has gaps"
    WATCHDOG = 9, "the watchdog ended the frame"
    ABORTED = 10, "the sender aborted the frame"
    DROPPED = 11, "a full queue dropped the frame"
    BAD_CHECKSUM = 12, "the checksum of a link is wrong"

    text: str

    def __new__(cls, code: int, text: str) -> Fault:
        """Create a code with its text."""
        fault = int.__new__(cls, code)
        fault._value_ = code
        fault.text = text
        return fault
