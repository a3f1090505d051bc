// SPDX-License-Identifier: Apache-2.0
// Accesses to the status of hardware whose transport a node uses, beside the node's messages: the node's sender sends
// the requests, and its receiver passes on the answers. The counterpart in Python is
// fusesoc_firm/node/status/status_exchange.py. C++17.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <utility>

#include <firm/transport.hpp>

namespace firm {

constexpr std::uint8_t kStatusId = 255;
constexpr char kNoStatusAnswer[] = "the hardware did not answer: it has no status, or is stalled";

// The bit of an address that requests a write.
constexpr std::uint32_t kStatusWrite = 1u << 31;

// The payload of requests and answers: an address and a word, little-endian.
constexpr std::size_t kStatusPayloadBytes = 8;

inline std::uint32_t little_endian(const Bytes& bytes, std::size_t place) {
  std::uint32_t word = 0;
  for (unsigned shift = 0; shift < 32; shift += 8) word |= static_cast<std::uint32_t>(bytes[place++]) << shift;
  return word;
}

// Return the frame that reads the register at an address, or, with bit 31 of the address, writes a word to it. Ids have
// one byte or two, which are equal in the status id.
inline Bytes status_request(std::uint32_t address, std::uint32_t word, std::size_t id_bytes = kIdBytes) {
  Bytes payload;
  for (const std::uint32_t part : {address, word}) {
    for (unsigned shift = 0; shift < 32; shift += 8) payload.push_back(static_cast<std::uint8_t>(part >> shift));
  }
  Bytes frame = pack_frame(kStatusId, payload.data(), payload.size());
  frame.insert(frame.begin(), id_bytes - kIdBytes, kStatusId);
  return frame;
}

// Return the address in a request or an answer, whatever the size of its id, or nothing for another frame.
inline std::optional<std::uint32_t> status_address(const Bytes& frame) {
  constexpr std::size_t kShort = kFrameHeaderBytes + kStatusPayloadBytes;
  if (frame.size() != kShort && frame.size() != kShort + 1) return std::nullopt;
  const std::size_t more = frame.size() - kShort;
  const bool is_status = frame[0] == kStatusId && frame[more] == kStatusId &&
                         payload_length(frame.data() + more) == kStatusPayloadBytes;
  if (!is_status) return std::nullopt;
  return little_endian(frame, more + kFrameHeaderBytes);
}

// Return the word of an answer, which ends with it.
inline std::uint32_t status_word(const Bytes& frame) { return little_endian(frame, frame.size() - 4); }

// One access at a time, by any thread.
class StatusExchange {
 public:
  // `send` passes a request to the node's sender; it may throw TransportError.
  explicit StatusExchange(std::function<void(const Bytes&)> send) : send_(std::move(send)) {}

  // Return the answer to a request. Throws TransportError if it does not arrive in time.
  Bytes access(const Bytes& request, std::chrono::nanoseconds patience) {
    const auto address = status_address(request);
    if (!address) throw TransportError("the frame is not a request of the status");
    const auto end = std::chrono::steady_clock::now() + patience;
    std::unique_lock<std::mutex> lock(mutex_);
    if (!changed_.wait_until(lock, end, [this] { return !is_in_use_; })) throw TransportError(kNoStatusAnswer);
    is_in_use_ = true;
    asked_ = address;
    answer_.reset();
    lock.unlock();
    try {
      send_(request);
    } catch (...) {
      release();
      throw;
    }
    lock.lock();
    changed_.wait_until(lock, end, [this] { return answer_.has_value(); });
    const std::optional<Bytes> answer = std::move(answer_);
    lock.unlock();
    release();
    if (!answer) throw TransportError(kNoStatusAnswer);
    return *answer;
  }

  // Take a frame from the hardware if it is an answer; return whether it is. The answer to an earlier request is dropped.
  bool take(const Bytes& frame) {
    const auto address = status_address(frame);
    if (!address) return false;
    const std::lock_guard<std::mutex> lock(mutex_);
    if (address == asked_) {
      answer_ = frame;
      changed_.notify_all();
    }
    return true;
  }

 private:
  void release() {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_in_use_ = false;
    asked_.reset();
    answer_.reset();
    changed_.notify_all();
  }

  const std::function<void(const Bytes&)> send_;
  std::mutex mutex_;  // protects the members below
  std::condition_variable changed_;
  bool is_in_use_ = false;
  std::optional<std::uint32_t> asked_;
  std::optional<Bytes> answer_;
};

}  // namespace firm
