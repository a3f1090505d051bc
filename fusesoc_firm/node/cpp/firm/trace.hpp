// SPDX-License-Identifier: Apache-2.0
// Each message's way as lines of CSV: what happened when, by the wall clock and, in simulated hardware, in which cycles.
//
//     wall_ns     std::chrono::steady_clock
//     event       received (put), queued, sent; taken (simulated hardware took the frame); burst, published
//     converter   the subscriber, or for what comes back the publisher
//     message     messages to the hardware are counted as they are put, those from it as they are published
//     bytes       of the payload; of a burst, all
//     first_cycle, last_cycle    of the frame's or burst's beats, empty for the others
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
  // Without a stream nothing is written.
  explicit Trace(std::ostream* stream) : stream_(stream) {
    if (stream_) *stream_ << "wall_ns,event,converter,message,bytes,first_cycle,last_cycle\n";
  }

  void write(const char* event, unsigned converter, std::uint64_t message, std::size_t bytes,
             const std::optional<Cycles>& cycles = std::nullopt) {
    if (!stream_) return;
    const std::lock_guard<std::mutex> lock(mutex_);
    write_line(event, {converter, message, bytes}, cycles);
  }

  // A message is about to be sent: simulated hardware may take it before the transport returns.
  void sending(unsigned converter, std::uint64_t message, std::size_t bytes) {
    if (!stream_) return;
    const std::lock_guard<std::mutex> lock(mutex_);
    sent_.push_back({converter, message, bytes});
  }

  // The next one of those sent was taken.
  void taken(const Cycles& cycles) {
    if (!stream_) return;
    const std::lock_guard<std::mutex> lock(mutex_);
    if (sent_.empty()) return;
    write_line("taken", sent_.front(), cycles);
    sent_.pop_front();
  }

  // What was sent will not be taken any more.
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
  std::deque<Message> sent_;  // and not yet taken
};

}  // namespace firm
