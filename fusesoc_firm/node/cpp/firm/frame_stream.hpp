// SPDX-License-Identifier: Apache-2.0
// A byte stream without markers, as from a UART or a process: the announced lengths determine the ends of frames.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>

#include <firm/transport.hpp>

namespace firm {

// Bytes that cannot begin a frame: some were lost or inserted.
class FrameError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class FrameStream {
 public:
  // Ids from `publishers` on and payloads longer than `longest` bytes are illegal.
  FrameStream(unsigned publishers, std::size_t longest) : publishers_(publishers), longest_(longest) {}

  // Take bytes until a frame is complete or none are left; return their number. Throws FrameError.
  std::size_t push(const std::uint8_t* bytes, std::size_t size) {
    std::size_t taken = 0;
    while (taken < size && !is_whole()) {
      const std::size_t count = std::min(size - taken, missing());
      frame_.insert(frame_.end(), bytes + taken, bytes + taken + count);
      taken += count;
      check();
    }
    return taken;
  }

  bool is_whole() const { return frame_.size() >= kFrameHeaderBytes && missing() == 0; }
  bool has_begun() const { return !frame_.empty(); }

  // Return the complete frame and begin the next one.
  Bytes pop() { return std::exchange(frame_, {}); }

 private:
  // The number of missing bytes of the id, then of the header, then of the frame.
  std::size_t missing() const {
    if (frame_.empty()) return kIdBytes;  // it is checked before the length arrives
    if (frame_.size() < kFrameHeaderBytes) return kFrameHeaderBytes - frame_.size();
    return kFrameHeaderBytes + payload_length(frame_.data()) - frame_.size();
  }

  void check() const {
    if (frame_[0] >= publishers_) {
      throw FrameError("the id is " + std::to_string(frame_[0]) + ", but the publishers are 0 to " +
                       std::to_string(publishers_ - 1));
    }
    if (frame_.size() == kFrameHeaderBytes && payload_length(frame_.data()) > longest_) {
      throw FrameError("a frame announces " + std::to_string(payload_length(frame_.data())) +
                       " bytes of payload; the longest payload has " + std::to_string(longest_) + " bytes");
    }
  }

  unsigned publishers_;
  std::size_t longest_;
  Bytes frame_;
};

}  // namespace firm
