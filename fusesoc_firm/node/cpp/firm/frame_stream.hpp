// SPDX-License-Identifier: Apache-2.0
// A row of bytes without marks, as a UART or a process has it: frames end where their announced lengths say.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>

#include <firm/transport.hpp>

namespace firm {

// Bytes that begin no frame: some were lost, or some were added.
class FrameError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class FrameStream {
 public:
  // Ids from `publishers` on and payloads longer than `longest` bytes are no frames.
  FrameStream(unsigned publishers, std::size_t longest) : publishers_(publishers), longest_(longest) {}

  // Take bytes until a frame is whole, or all of them: how many. Throws FrameError.
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

  // The frame that is whole; the next one may begin.
  Bytes pop() { return std::exchange(frame_, {}); }

 private:
  // Of the header, and when that is there, of the frame.
  std::size_t missing() const {
    if (frame_.empty()) return kIdBytes;  // it is looked at before the length comes
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
                       " bytes of payload; the longest has " + std::to_string(longest_));
    }
  }

  unsigned publishers_;
  std::size_t longest_;
  Bytes frame_;
};

}  // namespace firm
