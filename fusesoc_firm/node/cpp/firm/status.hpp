// SPDX-License-Identifier: Apache-2.0
// The status of hardware, read and written by frames of the status id (docs/reference/status.md):
//
//     auto transport = firm::open_transport("uart:/dev/ttyUSB1:1000000");
//     const firm::Status status = firm::read_status(*transport);
//     status.channels[0].faults[1];                 // frames of subscriber 0 that ended early (firm/faults.hpp)
//
// The hardware reports its dimensions, so no specification is needed. While a node uses the transport, only this node
// may read it: use Node::access_status instead. The counterpart in Python is fusesoc_firm/node/status/status.py.
// C++17, no dependencies except POSIX.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <firm/status_exchange.hpp>
#include <firm/transport.hpp>

namespace firm {

// The highest code of a fault; `ChannelStatus::faults` begins with the unused code 0.
constexpr std::size_t kFaultCodes = 12;

// The registers that are equal in all systems.
namespace status_register {
constexpr std::uint32_t kMagic = 0x00, kShape = 0x04, kControl = 0x08, kInterrupt = 0x0C, kInterruptEnable = 0x10;
constexpr std::uint32_t kLastFault = 0x14, kIdErrors = 0x18, kLinkErrors = 0x1C, kLost = 0x20, kDigest = 0x30;
constexpr std::uint32_t kCycles = 0x24, kFeatures = 0x28;
constexpr std::uint32_t kChannels = 0x8000, kChannelBytes = 0x40;
constexpr std::uint32_t kSignature = 0x00, kFrames = 0x34, kLongestWait = 0x38, kStamp = 0x3C;
}  // namespace status_register

// The counts of a subscriber or publisher; `longest_wait` is in cycles. `stamp` is the cycle after the first beat of a
// subscriber's newest frame, or after the last beat of a publisher's. The difference of two stamps is a time in
// cycles.
struct ChannelStatus {
  std::uint32_t signature = 0;
  std::array<std::uint32_t, kFaultCodes + 1> faults{};
  std::uint32_t frames = 0;
  std::uint32_t longest_wait = 0;
  std::uint32_t stamp = 0;  // 0 without time stamps
};

// The status of a system. The channels are the subscribers by id, then the publishers by id.
struct Status {
  unsigned subscribers = 0;
  unsigned publishers = 0;
  unsigned last_fault = 0;  // its code, or 0 before the first fault
  unsigned last_channel = 0;
  bool is_counting = false;                // channels are counted
  std::uint32_t interrupts = 0;            // that occurred
  std::uint32_t enabled_interrupts = 0;    // that raise the line
  std::uint32_t id_errors = 0;
  std::uint32_t link_errors = 0;
  std::uint32_t lost = 0;  // faults that were not counted in a channel
  bool has_time_stamps = false;
  std::uint32_t cycles = 0;  // since reset, modulo 2^32; 0 without time stamps
  std::string digest;
  std::vector<ChannelStatus> channels;
};

// A simulator may have to start first, on a busy machine.
constexpr std::chrono::seconds kStatusPatience(20);

// Accesses registers one at a time.
class StatusAccess {
 public:
  // Ids have one byte, or two with `idBytes: 2`.
  explicit StatusAccess(Transport& transport, std::chrono::nanoseconds patience = kStatusPatience,
                        std::size_t id_bytes = kIdBytes)
      : transport_(transport), patience_(patience), id_bytes_(id_bytes) {}

  // Return the word of the register at an address. Throws TransportError if there is no answer.
  std::uint32_t read(std::uint32_t address) { return access(address, 0); }

  // Write a word; return the word before. Throws TransportError if there is no answer.
  std::uint32_t write(std::uint32_t address, std::uint32_t word) { return access(address | kStatusWrite, word); }

  // Pass on a request with ids of this size; return the word of its answer. Throws TransportError if there is none.
  std::uint32_t pass(const Bytes& request) {
    const auto address = status_address(request);
    transport_.send(request.data(), request.size());
    const auto end = std::chrono::steady_clock::now() + patience_;
    for (auto left = patience_; left.count() > 0; left = end - std::chrono::steady_clock::now()) {
      const auto burst = transport_.receive(left);
      if (!burst) break;
      if (status_address(burst->data) == address) return status_word(burst->data);
    }
    throw TransportError(kNoStatusAnswer);
  }

 private:
  // Frames other than the answer are dropped.
  std::uint32_t access(std::uint32_t address, std::uint32_t word) {
    return pass(status_request(address, word, id_bytes_));
  }

  Transport& transport_;
  const std::chrono::nanoseconds patience_;
  const std::size_t id_bytes_;
};

// Return the digest of the hardware's system, 32 hexadecimal digits. `access` reads registers: StatusAccess, or
// StatusRegisters (firm/status_registers.hpp). Throws TransportError.
template <typename Access>
std::string read_digest(Access& access) {
  constexpr char kDigits[] = "0123456789abcdef";
  constexpr unsigned kWords = 4;
  std::string digest;
  for (unsigned number = kWords; number-- > 0;) {
    const std::uint32_t word = access.read(status_register::kDigest + 4 * number);
    for (unsigned shift = 32; shift > 0; shift -= 4) digest += kDigits[word >> (shift - 4) & 15u];
  }
  return digest;
}

// Throws TransportError if the hardware is not that of the system with the digest `expected`.
template <typename Access>
void check_digest(Access& access, const std::string& expected, const std::string& system) {
  const std::string found = read_digest(access);
  if (found != expected) {
    throw TransportError("the hardware is not that of '" + system + "': its digest is " + found +
                         ", and the specification's is " + expected);
  }
}

// Return the status of hardware. Throws TransportError if it does not answer, or if its registers are unknown.
inline Status read_status(Transport& transport, std::size_t id_bytes = kIdBytes) {
  constexpr std::uint32_t kMark = 0x4D524946, kVersion = 1;
  namespace at = status_register;
  StatusAccess access(transport, kStatusPatience, id_bytes);
  const std::uint32_t mark = access.read(at::kMagic), shape = access.read(at::kShape);
  if (mark != kMark || shape >> 24 != kVersion) throw TransportError("the hardware has another kind of status");
  Status status;
  status.subscribers = shape & 0xFFFu;
  status.publishers = shape >> 12 & 0xFFFu;
  status.is_counting = access.read(at::kControl) & 1u;
  status.interrupts = access.read(at::kInterrupt);
  status.enabled_interrupts = access.read(at::kInterruptEnable);
  const std::uint32_t last = access.read(at::kLastFault);
  status.last_fault = last & 0xFu;
  status.last_channel = last >> 4;
  status.id_errors = access.read(at::kIdErrors);
  status.link_errors = access.read(at::kLinkErrors);
  status.lost = access.read(at::kLost);
  status.has_time_stamps = access.read(at::kFeatures) & 1u;
  if (status.has_time_stamps) status.cycles = access.read(at::kCycles);
  status.digest = read_digest(access);
  status.channels.resize(status.subscribers + status.publishers);
  std::uint32_t base = at::kChannels;
  for (auto& channel : status.channels) {
    channel.signature = access.read(base + at::kSignature);
    for (std::uint32_t code = 1; code <= kFaultCodes; ++code) channel.faults[code] = access.read(base + 4 * code);
    channel.frames = access.read(base + at::kFrames);
    channel.longest_wait = access.read(base + at::kLongestWait);
    if (status.has_time_stamps) channel.stamp = access.read(base + at::kStamp);
    base += at::kChannelBytes;
  }
  return status;
}

}  // namespace firm
