// SPDX-License-Identifier: Apache-2.0
// File descriptors that close themselves, and a wait for a descriptor that another thread can end.
#pragma once

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <utility>

#include <firm/transport.hpp>

namespace firm {

// An owned file descriptor; a negative number means none.
class Descriptor {
 public:
  explicit Descriptor(int number = -1) : number_(number) {}
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  ~Descriptor() { reset(); }
  int get() const { return number_; }
  void reset() {
    if (number_ >= 0) ::close(std::exchange(number_, -1));
  }

 private:
  int number_;
};

[[noreturn]] inline void fail_with_errno(const std::string& what) {
  throw TransportError(what + ": " + std::strerror(errno));
}

// The end of a given time span.
class Deadline {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static Deadline at(Time end) {
    Deadline deadline(std::nullopt);
    deadline.end_ = end;
    return deadline;
  }
  explicit Deadline(Timeout timeout) {
    if (timeout) end_ = std::chrono::steady_clock::now() + *timeout;
  }
  bool is_over() const { return end_ && std::chrono::steady_clock::now() >= *end_; }
  // The remaining time in milliseconds, as poll() expects it: rounded up, negative for no limit.
  int milliseconds() const {
    if (!end_) return -1;
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(*end_ - std::chrono::steady_clock::now()).count();
    return static_cast<int>(std::clamp<std::int64_t>(left, 0, kLongest));
  }
  Deadline or_earlier(const Deadline& other) const {
    return !other.end_ || (end_ && *end_ <= *other.end_) ? *this : other;
  }

 private:
  static constexpr std::int64_t kLongest = 1 << 30;
  std::optional<Time> end_;
};

// Waits for a descriptor until a deadline, or until a thread ends all waiting.
class Waiter {
 public:
  Waiter() : event_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    if (event_.get() < 0) fail_with_errno("eventfd");
  }

  // Return whether `descriptor` is ready for `events` of poll(), or broken; false at the deadline or after end().
  bool wait(int descriptor, short events, const Deadline& deadline) const {
    pollfd both[] = {{descriptor, events, 0}, {event_.get(), POLLIN, 0}};
    for (;;) {
      const int ready = ::poll(both, 2, deadline.milliseconds());
      if (ready < 0 && errno != EINTR) fail_with_errno("poll");
      if (ready > 0 && both[1].revents != 0) return false;
      if (ready > 0) return true;
      if (ready == 0 && deadline.is_over()) return false;
    }
  }

  // End all current and later waits; any thread.
  void end() {
    const std::uint64_t one = 1;
    // It fails only if it has been called before.
    if (::write(event_.get(), &one, sizeof one) < 0) return;
  }

 private:
  Descriptor event_;
};

}  // namespace firm
