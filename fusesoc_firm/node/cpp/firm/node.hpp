// SPDX-License-Identifier: Apache-2.0
// A node's engine, independent of the middleware: payloads to and from the hardware (docs/reference/node-library.md).
//
//     firm::NodeConfiguration system;                       // its width, subscribers, publishers
//     firm::Node node(system, "dma:/dev/uio0:udmabuf0", publish);   // called with publisher, payload, size
//     std::thread engine([&] { status = node.run(); shut_the_middleware_down(); });
//     node.put(subscriber, payload, size);                  // any thread, such as a callback of the middleware
//     node.stop(std::chrono::seconds(10));                  // send all queued payloads, publish the responses
//     engine.join();
//
// The middleware has serialised the payloads, and the engine does not parse them. C++17, no dependencies except POSIX.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <iterator>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <ostream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <firm/bursts.hpp>
#include <firm/content.hpp>
#include <firm/faults.hpp>
#include <firm/log.hpp>
#include <firm/open_transport.hpp>
#include <firm/queues.hpp>
#include <firm/status_exchange.hpp>
#include <firm/trace.hpp>
#include <firm/transport.hpp>

namespace firm {

struct NodeConfiguration {
  unsigned width = 8;  // bits of the system's streams
  unsigned subscribers = 1;
  unsigned publishers = 1;
  std::size_t longest_payload = 1 << 26;    // bytes, in either direction
  // By subscriber: how a payload shows the end of its message, after which senders may append bytes. put() removes them.
  std::vector<Content> contents{};
  std::size_t queue_depth = 100;            // frames, for each subscriber
  // Frames, for subscribers with another depth; kUnlimitedDepth: no frame is dropped.
  std::map<unsigned, std::size_t> queue_depths{};
  // Subscribers whose frames wait in the queue of another one, so that both are sent in their order.
  std::map<unsigned, unsigned> shared_queues{};
  Overflow overflow = Overflow::kDropOldest;
  std::function<std::unique_ptr<Policy>()> policy = nullptr;  // default: least recently used
  unsigned restarts = 0;                    // the number of times that a failed transport is reopened
  std::chrono::nanoseconds restart_delay = std::chrono::milliseconds(500);
  // Hardware without a report of rest counts as at rest after this time without output.
  std::chrono::nanoseconds settling_time = std::chrono::milliseconds(200);
  bool has_status = false;  // the hardware has a status that is accessed by frames
  // The hardware rejected a frame of a subscriber, or ended one of a publisher in the middle; it was restarted; it has
  // no work. Called by threads of the node and of the transport.
  std::function<void(unsigned subscriber)> on_rejected = nullptr;
  std::function<void(unsigned publisher)> on_aborted = nullptr;
  std::function<void()> on_restart = nullptr;
  std::function<void()> on_rest = nullptr;
  std::function<void(Level level, const std::string& line)> log = nullptr;  // one line per fault
  std::ostream* trace = nullptr;  // CSV, one line per step of a message (firm/trace.hpp)
};

struct NodeStatistics {
  std::uint64_t received = 0;   // payloads passed to put()
  std::uint64_t dropped = 0;    // payloads dropped because their queue was full
  std::uint64_t sent = 0;       // frames that the transport has taken
  std::uint64_t published = 0;  // payloads received from the hardware
  std::uint64_t errors = 0;     // pulses of frame_error and id_error, losses of bytes, illegal bursts
  std::uint64_t restarts = 0;   // of the transport
};

class Node {
 public:
  // Called by a thread of the node. The payload is valid during the call only. The function must not stop the node.
  using Publish = std::function<void(unsigned publisher, const std::uint8_t* payload, std::size_t size)>;
  using Open = std::function<std::unique_ptr<Transport>(const TransportOptions&)>;

  // `open` creates the transport at the start of run() and at each restart. Throws std::invalid_argument.
  Node(NodeConfiguration configuration, Open open, Publish publish)
      : configuration_(checked(std::move(configuration))),
        open_(std::move(open)),
        publish_(std::move(publish)),
        queues_(depths(configuration_),
                configuration_.policy ? configuration_.policy() : nullptr, configuration_.overflow),
        trace_(configuration_.trace, [this](const std::string& line) { log(Level::kWarning, line); }),
        status_([this](const Bytes& request) { put_request(request); }) {
    for (const auto& [subscriber, other] : configuration_.shared_queues) queues_.share(subscriber, other);
  }

  // Create the transport from its address (firm/open_transport.hpp).
  Node(NodeConfiguration configuration, const std::string& address, Publish publish)
      : Node(
            std::move(configuration),
            [address](const TransportOptions& options) { return open_transport(address, options); },
            std::move(publish)) {}

  // Queue a payload for a subscriber, copied once; return whether it is queued. The payload is not queued if a full
  // queue drops the newest payload, or if the node stops. If the queues block, the call waits for space. Any thread may
  // call this function. Throws std::out_of_range for an unknown subscriber, and std::length_error for a payload that is
  // too long.
  bool put(unsigned subscriber, const std::uint8_t* payload, std::size_t size) {
    if (subscriber >= configuration_.subscribers) {
      throw std::out_of_range("subscriber is " + std::to_string(subscriber) + "; legal: 0 to " +
                              std::to_string(configuration_.subscribers - 1));
    }
    if (subscriber < configuration_.contents.size()) {
      size = content_size(configuration_.contents[subscriber], payload, size);
    }
    if (size > configuration_.longest_payload) {
      throw std::length_error("a payload for subscriber " + std::to_string(subscriber) + " has " +
                              std::to_string(size) + " bytes; the longest payload has " +
                              std::to_string(configuration_.longest_payload) + " bytes");
    }
    const std::uint64_t number = received_++;
    trace_.write("received", subscriber, number, size);
    try {
      const bool is_kept =
          queues_.put(subscriber, {number, pack_frame(static_cast<std::uint8_t>(subscriber), payload, size)});
      if (is_kept) trace_.write("queued", subscriber, number, size);
      return is_kept;
    } catch (const ClosedError&) {
      return false;
    }
  }

  // Run until stop(), or until the transport fails permanently. Return an exit status: 0, or 1 with error(). Call this
  // function only once.
  int run() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      has_begun_ = true;
    }
    std::optional<std::string> fault = session();
    while (fault && may_restart()) {
      log(Level::kWarning, *fault + "; the transport is opened again");
      ++restarts_;
      if (configuration_.on_restart) configuration_.on_restart();
      wait_before_restart();
      fault = session();
    }
    // The queues have lost their reader, so wake all threads that wait for space.
    queues_.close();
    const std::lock_guard<std::mutex> lock(mutex_);
    if (is_abandoned_) fault = "the time limit for stopping expired before all frames were sent and received";
    if (fault) log(Level::kError, error_ = *fault);
    has_ended_ = true;
    changed_.notify_all();
    return fault ? 1 : 0;
  }

  // Accept no more payloads, send the queued payloads, publish the responses, and end. Work that is not finished within
  // `drain` is abandoned, and run() reports this. The function returns when run() is about to return; any thread except
  // that of `publish` may call it.
  void stop(std::chrono::nanoseconds drain = std::chrono::seconds(10)) {
    queues_.close();
    std::unique_lock<std::mutex> lock(mutex_);
    is_stopping_ = true;
    changed_.notify_all();
    if (changed_.wait_for(lock, drain, [this] { return has_ended_; })) return;
    is_abandoned_ = true;
    if (transport_) transport_->close();
    changed_.wait(lock, [this] { return has_ended_ || !has_begun_; });
  }

  // Return the answer of the hardware's status to a request (firm/status_exchange.hpp). Any thread except that of
  // `publish` may call this function. Throws TransportError if there is no answer in time.
  Bytes access_status(const Bytes& request, std::chrono::nanoseconds patience = std::chrono::seconds(5)) {
    if (!configuration_.has_status) throw TransportError("the system has no 'status: frames'");
    return status_.access(request, patience);
  }

  NodeStatistics statistics() const {
    NodeStatistics statistics;
    statistics.received = received_;
    for (unsigned subscriber = 0; subscriber < configuration_.subscribers; ++subscriber) {
      statistics.dropped += queues_.dropped(subscriber);
    }
    statistics.sent = sent_;
    statistics.published = published_;
    statistics.errors = errors_;
    statistics.restarts = restarts_;
    return statistics;
  }

  // Return the reason why run() returned 1.
  std::string error() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return error_;
  }

 private:
  struct Numbered {
    std::uint64_t number;
    Bytes frame;
    bool is_request = false;  // of the status, instead of a payload
  };
  // The maximum time until the sender notices that the receiver has failed.
  static constexpr std::chrono::milliseconds kGlance{50};
  // The interval at which a receiver without bursts checks whether the hardware is at rest.
  static constexpr std::chrono::milliseconds kRestInterval{100};

  static NodeConfiguration checked(NodeConfiguration configuration) {
    if (configuration.subscribers < 1 || configuration.subscribers > 256) {
      throw std::invalid_argument("subscribers is " + std::to_string(configuration.subscribers) +
                                  "; legal: 1 to 256");
    }
    BurstJoiner(configuration.publishers, configuration.width);
    return configuration;
  }

  // Return the capacities of all queues.
  static std::vector<std::size_t> depths(const NodeConfiguration& configuration) {
    std::vector<std::size_t> found(configuration.subscribers, configuration.queue_depth);
    for (const auto& [subscriber, depth] : configuration.queue_depths) found.at(subscriber) = depth;
    // The last queue is that of the status.
    if (configuration.has_status) found.push_back(1);
    return found;
  }

  void put_request(const Bytes& request) {
    bool is_queued = false;
    try {
      is_queued = queues_.put(configuration_.subscribers, {0, request, true}, std::chrono::nanoseconds(0));
    } catch (const ClosedError&) {
      throw TransportError("the node is ending");
    }
    if (!is_queued) throw TransportError(kNoStatusAnswer);
  }

  // --- a session: one transport from start to end ---------------------------------------------------------------------

  // Run one transport; return its fault, or nothing if the node is done.
  std::optional<std::string> session() {
    std::optional<std::string> fault;
    try {
      const auto transport = open();
      std::thread receiver([&] { receive_all(*transport); });
      try {
        send_all(*transport);
        transport->finish();
        settle(*transport);
      } catch (const std::exception& error) {
        fault = error.what();
      }
      is_session_over_ = true;
      transport->close();
      receiver.join();
      const std::lock_guard<std::mutex> lock(mutex_);
      transport_ = nullptr;
      // The receiver detected the cause, the sender only its effect.
      if (receiver_fault_) fault = receiver_fault_;
    } catch (const std::exception& error) {
      fault = error.what();
    }
    return fault;
  }

  std::unique_ptr<Transport> open() {
    TransportOptions options;
    options.publishers = configuration_.publishers;
    options.longest_payload = configuration_.longest_payload;
    options.on_taken = [this](const Cycles& cycles) { trace_.taken(cycles); };
    options.on_error = [this](const HardwareError& error) { note(error); };
    trace_.forget_sent();
    auto transport = open_(options);
    const std::lock_guard<std::mutex> lock(mutex_);
    receiver_fault_.reset();
    is_session_over_ = false;
    moved_ = steady_nanoseconds();
    transport_ = transport.get();
    if (is_abandoned_) transport->close();
    return transport;
  }

  bool may_restart() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return restarts_ < configuration_.restarts && !is_abandoned_ && !has_publishing_failed_;
  }

  void wait_before_restart() {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait_for(lock, configuration_.restart_delay, [this] { return is_stopping_; });
  }

  // Send until the queues are closed and empty. The next session first sends the frame that could not be sent.
  void send_all(Transport& transport) {
    while (!has_receiver_failed()) {
      if (!unsent_) {
        auto next = queues_.get(kGlance);
        if (!next && queues_.is_drained()) return;
        if (!next) continue;
        unsent_ = std::move(next->item);
      }
      const Bytes& frame = unsent_->frame;
      if (unsent_->is_request) {
        trace_.sending_other();
        transport.send(frame.data(), frame.size());
        unsent_.reset();
        continue;
      }
      const unsigned subscriber = frame[0];
      const std::size_t size = frame.size() - kFrameHeaderBytes;
      trace_.sending(subscriber, unsent_->number, size);
      transport.send(frame.data(), frame.size());
      trace_.write("sent", subscriber, unsent_->number, size);
      ++sent_;
      moved_ = steady_nanoseconds();
      unsent_.reset();
    }
  }

  // Wait until all sent frames are processed.
  void settle(const Transport& transport) {
    while (!has_receiver_failed() && !is_abandoned()) {
      const auto is_at_rest = transport.is_at_rest();
      if (is_at_rest.value_or(steady_nanoseconds() - moved_ >= configuration_.settling_time.count())) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  void receive_all(Transport& transport) {
    BurstJoiner joiner(configuration_.publishers, configuration_.width, configuration_.longest_payload);
    try {
      while (const auto burst = next_burst(transport)) {
        if (configuration_.has_status && status_.take(burst->data)) continue;
        moved_ = steady_nanoseconds();
        take(joiner, *burst);
      }
      joiner.close();
    } catch (const BurstError& error) {
      note(error);
    } catch (const TransportError& error) {
      fail_receiver(transport, error.what(), false);
    } catch (const std::exception& error) {
      fail_receiver(transport, std::string("a payload could not be published: ") + error.what(), true);
    }
  }

  // Return the next burst, or nothing at the end of the session. Only this thread knows that all bursts are published.
  std::optional<Burst> next_burst(Transport& transport) {
    if (!configuration_.on_rest) return transport.receive();
    while (true) {
      auto burst = transport.receive(kRestInterval);
      if (burst || is_session_over_) return burst;
      const NodeStatistics counted = statistics();
      const bool is_sent = counted.sent + counted.dropped >= counted.received;
      if (is_sent && transport.is_at_rest().value_or(false)) configuration_.on_rest();
    }
  }

  void take(BurstJoiner& joiner, const Burst& burst) {
    const std::uint64_t number = published_;
    if (!burst.data.empty()) trace_.write("burst", burst.data[0], number, burst.data.size(), burst.cycles);
    std::optional<JoinedFrame> frame;
    try {
      frame = joiner.push(burst.data, burst.tid, burst.is_aborted);
    } catch (const BurstError& error) {
      note(error);
      if (configuration_.on_aborted && !burst.data.empty()) configuration_.on_aborted(burst.data[0]);
    }
    if (!frame) return;
    publish_(frame->id, frame->payload.data(), frame->payload.size());
    ++published_;
    trace_.write("published", frame->id, number, frame->payload.size());
  }

  // --- faults ---------------------------------------------------------------------------------------------------------

  // Close the transport as well, because hardware whose output is not taken may never have room for the sender.
  void fail_receiver(Transport& transport, const std::string& reason, bool is_publishing) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      receiver_fault_ = reason;
      has_publishing_failed_ = is_publishing;
    }
    transport.close();
  }

  bool has_receiver_failed() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return receiver_fault_.has_value();
  }

  bool is_abandoned() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return is_abandoned_;
  }

  void note(const BurstError& error) {
    ++errors_;
    log(Level::kWarning, error.what());
  }

  void note(const HardwareError& error) {
    ++errors_;
    const std::string where = error.cycle ? " in cycle " + std::to_string(*error.cycle) : "";
    const std::string who = error.converter ? "converter " + std::to_string(*error.converter) : "the link or the Manager";
    const bool is_known = error.code > 0 && error.code < std::size(kFaultTexts);
    log(Level::kWarning,
        who + " reports an error" + where + (is_known ? std::string(": ") + kFaultTexts[error.code] : ""));
    const bool is_subscriber = error.converter && *error.converter < configuration_.subscribers;
    if (is_subscriber && configuration_.on_rejected) configuration_.on_rejected(*error.converter);
  }

  void log(Level level, const std::string& line) {
    if (!configuration_.log) return;
    const std::lock_guard<std::mutex> lock(log_mutex_);
    configuration_.log(level, line);
  }

  const NodeConfiguration configuration_;
  const Open open_;
  const Publish publish_;
  SubscriberQueues<Numbered> queues_;
  std::mutex log_mutex_;  // before the trace, whose end may be a fault
  Trace trace_;
  StatusExchange status_;
  std::optional<Numbered> unsent_;  // used by the sender only

  std::atomic<std::uint64_t> received_{0}, sent_{0}, published_{0}, errors_{0};
  std::atomic<unsigned> restarts_{0};
  std::atomic<bool> is_session_over_{false};
  std::atomic<std::int64_t> moved_{0};  // time of the last frame sent or burst received, ns

  mutable std::mutex mutex_;  // protects the members below
  std::condition_variable changed_;
  Transport* transport_ = nullptr;  // only during a session
  std::optional<std::string> receiver_fault_;
  bool has_publishing_failed_ = false;
  bool has_begun_ = false;
  bool has_ended_ = false;
  bool is_stopping_ = false;
  bool is_abandoned_ = false;
  std::string error_;
};

}  // namespace firm
