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
    OVER_BUFFER = 6, "the payload is longer than the publisher's buffer", "give the publisher a larger 'buffer'"
    TOO_LONG = 7, "the payload is longer than maxLength", "give the block a larger 'maxLength'"
    BROKEN_BEAT = 8, "a beat is neither full nor the last one, is empty, or has gaps"
    WATCHDOG = 9, "the watchdog ended the frame"
    ABORTED = 10, "the sender aborted the frame"
    DROPPED = 11, "a full queue dropped the frame"
    BAD_CHECKSUM = 12, "the checksum of a link is wrong"

    text: str
    remedy: str

    def __new__(cls, code: int, text: str, remedy: str = "") -> Fault:
        """Create a code with its text and what its user can do."""
        fault = int.__new__(cls, code)
        fault._value_ = code
        fault.text = text
        fault.remedy = remedy
        return fault


def told(code: int) -> str:
    """Return a code for users: its text, its number and its remedy. Of code 0, the fault is unknown."""
    fault = next((item for item in Fault if item == code), None)
    if fault is None:
        return "it is malformed, or longer than 'maxLength'"
    return f"{fault.text} (code {code})" + (f"; {fault.remedy}" if fault.remedy else "")
