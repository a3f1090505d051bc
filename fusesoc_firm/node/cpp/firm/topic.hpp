// SPDX-License-Identifier: Apache-2.0
// A topic of a system, and what a node asks of a middleware: firm/ros1.hpp and firm/ros2.hpp are two. C++17.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>

namespace firm {

// A topic, and the id of its converter in the hardware; none where only software has to do with it. `signature` is that of the message's definition, ROS 1's MD5
// sum or ROS 2's hash (RIHS01), and `definition` its text with those of all messages within it, as ROS 1 announces it.
struct Topic {
  std::optional<unsigned> id;
  std::string name;
  std::string type;
  std::string signature;
  std::string definition{};
};

// A serialised message: taken from the middleware, or to be published. The bytes are the caller's.
using MessageHandler = std::function<void(const std::uint8_t* data, std::size_t size)>;

// The middleware is not there, or does not know what it is asked for.
class MiddlewareError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace firm
