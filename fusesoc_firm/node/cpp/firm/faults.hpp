// SPDX-License-Identifier: Apache-2.0
// The faults of frames: the codes that converters, the Manager and links report in frame_error_code. 0 is not a fault.
// `make constants` writes the codes and texts from fusesoc_firm/frame/faults.py.
#pragma once

#include <cstdint>

namespace firm {

enum class Fault : std::uint8_t {
  kBadLength = 1,
  kShortFrame = 2,
  kLongFrame = 3,
  kBadEncoding = 4,
  kBadCount = 5,
  kOverBuffer = 6,
  kTooLong = 7,
  kBrokenBeat = 8,
  kWatchdog = 9,
  kAborted = 10,
  kDropped = 11,
  kBadChecksum = 12,
};

// The text of each code.
constexpr const char* kFaultTexts[] = {
    "no fault",
    "the length is not that of the message",
    "the frame or a part of it ended early",
    "the frame or a part of it continued after its length",
    "the encoding is unknown",
    "a count exceeds its bound, or a text lacks its terminating zero",
    "the payload is longer than the publisher's buffer",
    "the payload is longer than maxLength",
    "a beat is neither full nor the last one, is empty, or has gaps",
    "the watchdog ended the frame",
    "the sender aborted the frame",
    "a full queue dropped the frame",
    "the checksum of a link is wrong",
};

}  // namespace firm
