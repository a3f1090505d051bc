// SPDX-License-Identifier: Apache-2.0
// Traces each message as lines of CSV: the steps with their times by the wall clock and, in simulated hardware, the
// cycles.
//
//     wall_ns     std::chrono::steady_clock
//     event       received (put), queued, sent; taken (simulated hardware took the frame); burst, published
//     converter   the subscriber, or the publisher for messages from the hardware
//     message     number of the message: to the hardware in the order of put(), from it in the order of publishing
//     bytes       length of the payload; for a burst, of the whole burst
//     first_cycle, last_cycle    of the beats of the frame or burst, otherwise empty
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <ostream>
#include <string>
#include <utility>

#include <firm/queues.hpp>
#include <firm/transport.hpp>

namespace firm {

class Trace {
 public:
  // Without a stream, nothing is written. If the stream fails, such as on a full disk, the trace ends with a line in
  // `log`.
  explicit Trace(std::ostream* stream, std::function<void(const std::string&)> log = nullptr)
      : stream_(stream), log_(std::move(log)) {
    if (stream_) *stream << "wall_ns,event,converter,message,bytes,first_cycle,last_cycle\n";
  }

  ~Trace() {
    if (!stream_) return;
    stream_.load()->flush();
    end_if_failed();
  }
  Trace(const Trace&) = delete;
  Trace& operator=(const Trace&) = delete;

  void write(const char* event, unsigned converter, std::uint64_t message, std::size_t bytes,
             const std::optional<Cycles>& cycles = std::nullopt) {
    if (!stream_) return;
    const std::lock_guard<std::mutex> lock(mutex_);
    write_line(event, {converter, message, bytes}, cycles);
  }

  // Record a message before it is sent, since simulated hardware may take the message before the transport returns.
  void sending(unsigned converter, std::uint64_t message, std::size_t bytes) {
    if (!stream_) return;
    const std::lock_guard<std::mutex> lock(mutex_);
    sent_.push_back(Message{converter, message, bytes});
  }

  // Record that a frame other than a message is being sent to the hardware.
  void sending_other() {
    if (!stream_) return;
    const std::lock_guard<std::mutex> lock(mutex_);
    sent_.push_back(std::nullopt);
  }

  // Record that simulated hardware took the next sent message.
  void taken(const Cycles& cycles) {
    if (!stream_) return;
    const std::lock_guard<std::mutex> lock(mutex_);
    if (sent_.empty()) return;
    if (sent_.front()) write_line("taken", *sent_.front(), cycles);
    sent_.pop_front();
  }

  // Forget all sent messages, which the hardware will never take.
  void forget_sent() {
    const std::lock_guard<std::mutex> lock(mutex_);
    sent_.clear();
  }

 private:
  struct Message {
    unsigned converter;
    std::uint64_t number;
    std::size_t bytes;
  };

  void write_line(const char* event, const Message& message, const std::optional<Cycles>& cycles) {
    std::ostream* const stream = stream_;
    if (!stream) return;
    *stream << steady_nanoseconds() << ',' << event << ',' << message.converter << ',' << message.number << ','
            << message.bytes << ',';
    if (cycles) *stream << cycles->first;
    *stream << ',';
    if (cycles) *stream << cycles->last;
    *stream << '\n';
    end_if_failed();
  }

  void end_if_failed() {
    if (stream_.load()->good()) return;
    stream_ = nullptr;
    if (log_) log_("the trace ends, since it cannot be written");
  }

  std::atomic<std::ostream*> stream_;
  const std::function<void(const std::string&)> log_;
  std::mutex mutex_;
  std::deque<std::optional<Message>> sent_;  // but not yet taken; nothing for other frames
};

}  // namespace firm
