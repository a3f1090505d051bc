// SPDX-License-Identifier: Apache-2.0
// A topic of a system, and the interface of a middleware, which firm/ros1.hpp and firm/ros2.hpp implement. C++17.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>

namespace firm {

// The quality of service of a topic: `depth` is the capacity of its queues in messages. In ROS 1, topics are always
// reliable, and a publisher that is transient local latches.
struct Quality {
  bool is_reliable = true;
  bool is_transient_local = false;
  std::size_t depth = 100;
};

// A topic and the id of its converter in the hardware; no id if only software uses the topic. `signature` is the
// definition's signature: the MD5 sum for ROS 1, the RIHS01 hash for ROS 2. If `is_numbered`, a message begins with its
// publisher's count, since its first field is a Header of ROS 1. `definition` is the definition's text with the texts of
// all nested messages, as ROS 1 announces it.
struct Topic {
  std::optional<unsigned> id;
  std::string name;
  std::string type;
  std::string signature;
  Quality quality{};
  bool is_numbered = false;
  std::string definition{};
};

// The numbers of a topic's messages, of which each publisher counts its own.
class Gaps {
 public:
  // Return the number of missing messages before the message with this number; a restart is not a gap.
  std::uint64_t missing(const std::string& publisher, std::uint64_t number) {
    const auto [last, is_first] = last_.try_emplace(publisher, number);
    const std::uint64_t gap = !is_first && number > last->second ? number - last->second - 1 : 0;
    last->second = number;
    return gap;
  }

 private:
  std::map<std::string, std::uint64_t> last_;
};

// A function that handles a serialised message, from the middleware or to publish. The caller owns the bytes.
using MessageHandler = std::function<void(const std::uint8_t* data, std::size_t size)>;

// The middleware is missing, or a requested item is unknown to it.
class MiddlewareError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace firm
