// SPDX-License-Identifier: Apache-2.0
// The end of a message in its payload, since senders of ROS 2 may append bytes: rclpy's serialize_message returns its
// whole buffer. C++17.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace firm {

// What is needed of a message's definition, as numbers: the length of the prefix, the number of its checked bytes, these
// bytes, and terms:
//
//     n > 0                                       n bytes
//     -a                                          padding to a multiple of `a`, counted from the end of the prefix
//     0, count, terminator, stride, size, body    `size` numbers of terms, repeated
//
// If a repetition's `count` is -1, the four bytes before it are the count, which includes `terminator`. `stride` is the
// size of each element after the first, or -1 if the sizes differ. Without numbers, senders append no bytes.
using Content = std::vector<std::int64_t>;

namespace detail {

class ContentWalk {
 public:
  ContentWalk(const Content& content, const std::uint8_t* payload, std::size_t size)
      : content_(content), fields_(payload + content[0]), end_(static_cast<std::int64_t>(size) - content[0]) {}

  // Return the position after the terms from `place` to before `last`. Positions count from the end of the prefix.
  std::int64_t behind(std::size_t place, std::size_t last, std::int64_t position) const {
    while (place < last) {
      const std::int64_t number = content_[place++];
      if (number > 0) {
        position += number;
      } else if (number < 0) {
        position += (-number - position % -number) % -number;
      } else {
        std::int64_t count = content_[place];
        if (count < 0) count = std::max<std::int64_t>(count_before(position) - content_[place + 1], 0);
        const std::int64_t stride = content_[place + 2];
        const std::size_t body = place + 4;
        place = body + static_cast<std::size_t>(content_[place + 3]);
        position = behind_elements(body, place, position, count, stride);
      }
    }
    return position;
  }

 private:
  std::int64_t behind_elements(std::size_t place, std::size_t last, std::int64_t position, std::int64_t count,
                               std::int64_t stride) const {
    if (count > 0 && stride >= 0) return behind(place, last, position) + (count - 1) * stride;
    // A count in a damaged payload can be billions.
    for (; count > 0 && position <= end_; --count) position = behind(place, last, position);
    return position;
  }

  std::int64_t count_before(std::int64_t position) const {
    if (position < 4 || position > end_) return 0;
    const std::uint8_t* bytes = fields_ + position - 4;
    return bytes[0] | bytes[1] << 8 | bytes[2] << 16 | static_cast<std::int64_t>(bytes[3]) << 24;
  }

  const Content& content_;
  const std::uint8_t* fields_;
  std::int64_t end_;
};

}  // namespace detail

// Return the size of a payload without the bytes after its message. The size of a payload of another encoding, or of one
// that ends within its message, is returned unchanged, so that its reader reports the fault.
inline std::size_t content_size(const Content& content, const std::uint8_t* payload, std::size_t size) {
  if (content.empty() || size < static_cast<std::size_t>(content[0])) return size;
  const auto terms = static_cast<std::size_t>(2 + content[1]);
  for (std::size_t place = 2; place < terms; ++place) {
    if (payload[place - 2] != content[place]) return size;
  }
  const std::int64_t found = content[0] + detail::ContentWalk(content, payload, size).behind(terms, content.size(), 0);
  return std::min(size, static_cast<std::size_t>(found));
}

}  // namespace firm
