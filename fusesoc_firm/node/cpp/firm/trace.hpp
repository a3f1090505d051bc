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

#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <ostream>

#include <firm/queues.hpp>
#include <firm/transport.hpp>

namespace firm {

class Trace {
 public:
  // Without a stream, nothing is written.
  explicit Trace(std::ostream* stream) : stream_(stream) {
    if (stream_) *stream_ << "wall_ns,event,converter,message,bytes,first_cycle,last_cycle\n";
  }

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
    *stream_ << steady_nanoseconds() << ',' << event << ',' << message.converter << ',' << message.number << ','
             << message.bytes << ',';
    if (cycles) *stream_ << cycles->first;
    *stream_ << ',';
    if (cycles) *stream_ << cycles->last;
    *stream_ << '\n';
  }

  std::ostream* stream_;
  std::mutex mutex_;
  std::deque<std::optional<Message>> sent_;  // but not yet taken; nothing for other frames
};

}  // namespace firm
