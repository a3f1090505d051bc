// SPDX-License-Identifier: Apache-2.0
// The lines of a node for its user: on stderr and, while ROS runs, in ROS's log, the topic /rosout. C++17.
//
//     firm::node_log().say(firm::Level::kWarning, "a message is ignored");
#pragma once

#include <cstdint>
#include <functional>
#include <iostream>
#include <mutex>
#include <string>
#include <utility>

namespace firm {

// The severity of a line, by the numbers of ROS 2: normal work, a fault after which the node continues, and one that
// ends it.
enum class Level : std::uint8_t { kInfo = 20, kWarning = 30, kError = 40 };

using TakeLine = std::function<void(Level level, const std::string& line)>;

// Any thread may call its functions.
class Log {
 public:
  // Print a line, and put it into ROS's log.
  void say(Level level, const std::string& line) {
    print(line);
    pass(level, line);
  }

  void print(const std::string& line) {
    const std::lock_guard<std::mutex> lock(mutex_);
    std::cerr << line << std::endl;
  }

  // Put a line into ROS's log only.
  void pass(Level level, const std::string& line) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (take_) take_(level, line);
  }

  // Use a log of ROS; an empty function ends this.
  void connect(TakeLine take) {
    const std::lock_guard<std::mutex> lock(mutex_);
    take_ = std::move(take);
  }

 private:
  std::mutex mutex_;
  TakeLine take_;
};

// Return the log of this process.
inline Log& node_log() {
  static Log log;
  return log;
}

}  // namespace firm
