// SPDX-License-Identifier: Apache-2.0
// A topic of a system, and the interface of a middleware, which firm/ros1.hpp and firm/ros2.hpp implement. C++17.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>

namespace firm {

// A topic and the id of its converter in the hardware; no id if only software uses the topic. `signature` is the
// definition's signature: the MD5 sum for ROS 1, the RIHS01 hash for ROS 2. `definition` is the definition's text with
// the texts of all nested messages, as ROS 1 announces it.
struct Topic {
  std::optional<unsigned> id;
  std::string name;
  std::string type;
  std::string signature;
  std::string definition{};
};

// A function that handles a serialised message, from the middleware or to publish. The caller owns the bytes.
using MessageHandler = std::function<void(const std::uint8_t* data, std::size_t size)>;

// The middleware is missing, or does not know a requested item.
class MiddlewareError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace firm
