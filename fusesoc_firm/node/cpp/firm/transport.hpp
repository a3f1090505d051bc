// SPDX-License-Identifier: Apache-2.0
// The single interface to the hardware, which sends frames and receives bursts (docs/reference/transports.md).
//
//     auto transport = firm::open_transport("pipe:./simulator");   // firm/open_transport.hpp
//     transport->send(frame.data(), frame.size());                 // waits while the hardware is not ready
//     auto burst = transport->receive(std::chrono::seconds(1));    // nothing if no burst arrived in time
//
// The counterpart in Python is fusesoc_firm/node/transport/transport.py. C++17, no dependencies except POSIX.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <stdexcept>
#include <vector>

namespace firm {

using Bytes = std::vector<std::uint8_t>;
// Nothing: no limit.
using Timeout = std::optional<std::chrono::nanoseconds>;

// A frame begins with the id and the length of its payload, which is little-endian.
constexpr std::size_t kIdBytes = 1;
constexpr std::size_t kFrameHeaderBytes = 5;

// The hardware or the path to it is lost or violates the protocol; the transport is unusable.
class TransportError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// The cycles of clk in which simulated hardware took the first and the last beat.
struct Cycles {
  std::uint64_t first;
  std::uint64_t last;
};

// The valid bytes (by tkeep) of the system's stream up to a tlast: a frame or a part of a frame. `tid` is the stream's
// tid, if the transport carries it; `cycles` is known only for simulated hardware.
struct Burst {
  Bytes data;
  std::optional<unsigned> tid = std::nullopt;
  std::optional<Cycles> cycles = std::nullopt;
  bool is_aborted = false;  // it aborts its frame
};

// An error after which the transport continues.
struct HardwareError {
  // The converter whose frame_error pulsed; nothing for id_error, and for bytes that a link lost.
  std::optional<unsigned> converter = std::nullopt;
  std::optional<std::uint64_t> cycle = std::nullopt;
  unsigned code = 0;  // of the converter's fault (faults.hpp), or 0 if the transport does not tell it
};

// A transport's parameters from the system, and callbacks for events other than bursts. The transport's threads call
// the functions.
struct TransportOptions {
  unsigned publishers = 256;              // of the Manager
  std::size_t longest_payload = 1 << 26;  // bytes, in either direction
  std::function<void(const Cycles&)> on_taken = nullptr;  // simulated hardware took the next sent frame
  std::function<void(const HardwareError&)> on_error = nullptr;
};

// A path to the hardware. One thread may send while another receives; closing the transport ends both calls.
class Transport {
 public:
  virtual ~Transport() = default;

  // Send a whole frame; returns when the hardware, or a bounded buffer, has it. Throws TransportError, even if the
  // transport is closed.
  virtual void send(const std::uint8_t* frame, std::size_t size) = 0;

  // Return the next burst; nothing on timeout or when the transport is closed. Throws TransportError.
  virtual std::optional<Burst> receive(Timeout timeout = std::nullopt) = 0;

  // Declare that no more frames follow. Called by the sending thread; most hardware ignores it.
  virtual void finish() {}

  // Return whether all sent frames are processed and all responses are received, or nothing if this is unknown.
  virtual std::optional<bool> is_at_rest() const { return std::nullopt; }

  // Close the transport from any thread; sent frames may be lost. A second call does nothing.
  virtual void close() = 0;
};

// Return the length of a frame's payload from its header.
inline std::uint32_t payload_length(const std::uint8_t* frame) {
  std::uint32_t length = 0;
  for (std::size_t place = kFrameHeaderBytes; place > kIdBytes; --place) length = length << 8 | frame[place - 1];
  return length;
}

// Return a frame with this payload. Throws std::length_error if the length does not fit its field.
inline Bytes pack_frame(std::uint8_t id, const std::uint8_t* payload, std::size_t size) {
  if (size > UINT32_MAX) throw std::length_error("a payload of 4 GiB or more does not fit into a frame");
  Bytes frame;
  frame.reserve(kFrameHeaderBytes + size);
  frame.push_back(id);
  for (unsigned shift = 0; shift < 32; shift += 8) frame.push_back(static_cast<std::uint8_t>(size >> shift));
  if (size > 0) frame.insert(frame.end(), payload, payload + size);
  return frame;
}

}  // namespace firm
