// SPDX-License-Identifier: Apache-2.0
// Frames on a link that carries bytes (UART, SPI): COBS of the frame and its CRC-32, and a zero byte at the end.
//
// A zero byte ends each frame and occurs nowhere else (S. Cheshire and M. Baker, "Consistent Overhead Byte Stuffing",
// 1999). The CRC-32 is that of Ethernet and zlib, lowest byte first. A lost, additional or wrong byte costs the frame
// in which it occurs, and the next frame if it was the zero byte between them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>

#include <firm/transport.hpp>

namespace firm {

// The CRC-32 of each byte.
constexpr std::array<std::uint32_t, 256> crc32_table() {
  std::array<std::uint32_t, 256> entries{};
  for (std::uint32_t byte = 0; byte < 256; ++byte) {
    std::uint32_t crc = byte;
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ ((crc & 1u) != 0 ? 0xEDB88320u : 0u);
    entries[byte] = crc;
  }
  return entries;
}

class Crc32 {
 public:
  void add(std::uint8_t byte) { crc_ = kTable[(crc_ ^ byte) & 0xFFu] ^ crc_ >> 8; }

  std::uint32_t value() const { return ~crc_; }
  // The last four bytes are the checksum of those before.
  bool is_right() const { return crc_ == 0xDEBB20E3u; }

 private:
  static constexpr std::array<std::uint32_t, 256> kTable = crc32_table();

  std::uint32_t crc_ = 0xFFFFFFFFu;
};

constexpr std::size_t kChecksumBytes = 4;
// The code of a full block, which no zero follows.
constexpr std::uint8_t kFullBlock = 0xFF;

// Return a frame as it is sent, with its checksum and the zero byte at its end.
inline Bytes link_encoded(const std::uint8_t* frame, std::size_t size) {
  Bytes coded{1};
  coded.reserve(size + size / 254 + kChecksumBytes + 3);
  std::size_t code = 0;  // the place of the block's code, which counts the block's bytes and itself
  bool is_full = false;
  Crc32 crc;
  const auto add = [&](std::uint8_t byte) {
    if (is_full) {
      code = coded.size();
      coded.push_back(1);
      is_full = false;
    }
    if (byte == 0) {
      code = coded.size();
      coded.push_back(1);
    } else {
      coded.push_back(byte);
      is_full = ++coded[code] == kFullBlock;
    }
  };
  for (std::size_t place = 0; place < size; ++place) {
    crc.add(frame[place]);
    add(frame[place]);
  }
  const std::uint32_t checksum = crc.value();
  for (std::size_t place = 0; place < kChecksumBytes; ++place) add(static_cast<std::uint8_t>(checksum >> 8 * place));
  coded.push_back(0);
  return coded;
}

enum class LinkEvent { kNothing, kFrame, kBroken };

// Finds the frames in received bytes. A frame whose code, length or checksum is wrong, or whose payload is longer than
// `longest` bytes, is dropped. Bytes before the first zero byte may be the rest of a frame; they are not reported.
class LinkDecoder {
 public:
  explicit LinkDecoder(std::size_t longest) : most_(kFrameHeaderBytes + longest + kChecksumBytes) {}

  // Take one byte. After kFrame, `pop` returns a frame; kBroken reports a dropped frame.
  LinkEvent push(std::uint8_t byte) {
    if (byte == 0) return end();
    has_begun_ = true;
    if (left_ == 0) {
      if (is_zero_due_) keep(0);
      left_ = byte - 1u;
      is_zero_due_ = byte != kFullBlock;
    } else {
      --left_;
      keep(byte);
    }
    return LinkEvent::kNothing;
  }

  // Return the complete frame.
  Bytes pop() { return std::exchange(whole_, {}); }

 private:
  void keep(std::uint8_t byte) {
    crc_.add(byte);
    if (frame_.size() <= most_) frame_.push_back(byte);
  }

  LinkEvent end() {
    const bool has_begun = std::exchange(has_begun_, false);
    const bool is_synchronised = std::exchange(is_synchronised_, true);
    const bool is_good = left_ == 0 && crc_.is_right() && frame_.size() <= most_ &&
                         frame_.size() >= kFrameHeaderBytes + kChecksumBytes &&
                         frame_.size() == kFrameHeaderBytes + kChecksumBytes + payload_length(frame_.data());
    if (is_good) {
      frame_.resize(frame_.size() - kChecksumBytes);
      whole_ = std::exchange(frame_, {});
    }
    frame_.clear();
    left_ = 0;
    is_zero_due_ = false;
    crc_ = {};
    if (is_good) return LinkEvent::kFrame;
    return has_begun && is_synchronised ? LinkEvent::kBroken : LinkEvent::kNothing;
  }

  std::size_t most_;  // bytes of a frame with its checksum
  Bytes frame_;       // only as much as shows that it is too long
  Bytes whole_;
  Crc32 crc_;
  unsigned left_ = 0;         // bytes of the block still to come; at zero, the code of the next one comes
  bool is_zero_due_ = false;  // a zero follows this block
  bool has_begun_ = false;
  bool is_synchronised_ = false;
};

}  // namespace firm
