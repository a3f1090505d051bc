// SPDX-License-Identifier: Apache-2.0
// Joins the bursts of a preemptive Manager to frames (docs/reference/manager.md, "Bursts").
//
//     firm::BurstJoiner joiner(4, 64);                     // publishers, bits of the stream
//     if (auto frame = joiner.push(bytes, size)) {         // the bytes between two tlast that tkeep marks as valid
//       deliver(frame->id, frame->payload);
//     }
//     joiner.close();
//
// An uninterrupted frame is one burst, so the class also serves a Manager without preemption. It does the same as
// fusesoc_firm/node/engine/bursts.py, with the same messages; both are tested with the same bursts. C++17, no dependencies.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace firm {

// A burst that no Manager sends. The part of its frame received so far is dropped.
class BurstError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// The hardware aborted a frame, whose received part is dropped.
class AbortedFrameError : public BurstError {
 public:
  using BurstError::BurstError;
};

// A complete frame: the id of its publisher and its payload.
struct JoinedFrame {
  std::uint8_t id;
  std::vector<std::uint8_t> payload;
};

// Joins bursts by id until a frame has the length that its header announces; each stream needs its own joiner.
class BurstJoiner {
 public:
  // For a Manager with `publishers` (1 to 256) and a stream of `width` bits. A frame that announces a payload of more
  // than `longest` bytes is rejected when its header is complete, before it takes memory. Throws std::invalid_argument.
  BurstJoiner(unsigned publishers, unsigned width,
              std::size_t longest = std::numeric_limits<std::size_t>::max())
      : publishers_(publishers), beat_bytes_(width / 8), longest_(longest) {
    if (publishers < 1 || publishers > 256) {
      throw std::invalid_argument("publishers is " + std::to_string(publishers) + "; legal: 1 to 256");
    }
    if (width < 8 || width > 512 || (width & (width - 1)) != 0) {
      throw std::invalid_argument("width is " + std::to_string(width) + "; legal: 8, 16, 32, 64, 128, 256, 512");
    }
  }

  // Take a burst and return the frame that it completes, if any. `tid` is the stream's `tid`, if the transport has one;
  // it must equal the id. `is_aborted` if the burst aborts its frame. Throws BurstError.
  std::optional<JoinedFrame> push(const std::uint8_t* burst, std::size_t size,
                                  std::optional<unsigned> tid = std::nullopt, bool is_aborted = false) {
    const std::uint8_t id = checked_id(burst, size, tid);
    if (is_aborted) {
      begun_.erase(id);
      throw AbortedFrameError("the frame with id " + std::to_string(id) + " was aborted");
    }
    std::vector<std::uint8_t> frame;
    if (auto begun = begun_.find(id); begun != begun_.end()) {
      frame = std::move(begun->second);
      begun_.erase(begun);
      if (size <= beat_bytes_) {
        throw BurstError("the burst that resumes the frame with id " + std::to_string(id) + " contains nothing but the id");
      }
      // Only these bytes were inserted. They fill a beat, so that the bytes after them stay in their lanes.
      frame.insert(frame.end(), burst + beat_bytes_, burst + size);
    } else {
      frame.assign(burst, burst + size);
    }
    if (is_whole(id, frame)) {
      frame.erase(frame.begin(), frame.begin() + kHeaderBytes);
      return JoinedFrame{id, std::move(frame)};
    }
    if (size % beat_bytes_ != 0) {
      throw BurstError("a burst with id " + std::to_string(id) + " ends within a beat: " + std::to_string(size) +
                       " bytes at " + std::to_string(beat_bytes_) + " per beat, and the frame is incomplete");
    }
    begun_.emplace(id, std::move(frame));
    return std::nullopt;
  }

  std::optional<JoinedFrame> push(const std::vector<std::uint8_t>& burst,
                                  std::optional<unsigned> tid = std::nullopt, bool is_aborted = false) {
    return push(burst.data(), burst.size(), tid, is_aborted);
  }

  // The ids of incomplete frames in ascending order.
  std::vector<std::uint8_t> unfinished() const {
    std::vector<std::uint8_t> ids;
    for (const auto& begun : begun_) ids.push_back(begun.first);
    return ids;
  }

  // End the stream. Throws BurstError if a frame is incomplete.
  void close() {
    std::string parts;
    for (const auto& [id, frame] : begun_) {
      if (!parts.empty()) parts += ", ";
      parts += std::to_string(frame.size()) + " bytes with id " + std::to_string(id);
    }
    begun_.clear();
    if (!parts.empty()) throw BurstError("the stream ends within frames: " + parts);
  }

 private:
  static constexpr std::size_t kHeaderBytes = 5;  // the id and the length of the payload

  std::uint8_t checked_id(const std::uint8_t* burst, std::size_t size, std::optional<unsigned> tid) const {
    if (size == 0) throw BurstError("the burst is empty");
    const unsigned id = burst[0];
    if (id >= publishers_) {
      throw BurstError("the id is " + std::to_string(id) + ", but the publishers are 0 to " +
                       std::to_string(publishers_ - 1));
    }
    if (tid && *tid != id) {
      throw BurstError("tid is " + std::to_string(*tid) + ", but the burst begins with id " + std::to_string(id));
    }
    return burst[0];
  }

  bool is_whole(std::uint8_t id, const std::vector<std::uint8_t>& frame) const {
    if (frame.size() < kHeaderBytes) return false;
    std::uint64_t length = 0;
    for (std::size_t place = kHeaderBytes - 1; place > 0; --place) length = length << 8 | frame[place];
    if (length > longest_) {
      throw BurstError("the frame with id " + std::to_string(id) + " announces " + std::to_string(length) +
                       " bytes of payload; the longest payload has " + std::to_string(longest_) + " bytes");
    }
    const std::uint64_t received = frame.size() - kHeaderBytes;
    if (received > length) {
      throw BurstError("the frame with id " + std::to_string(id) + " is " + std::to_string(received - length) +
                       " bytes longer than its header announces");
    }
    return received == length;
  }

  unsigned publishers_;
  std::size_t beat_bytes_;
  std::size_t longest_;
  std::map<std::uint8_t, std::vector<std::uint8_t>> begun_;
};

}  // namespace firm
