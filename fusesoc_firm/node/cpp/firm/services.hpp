// SPDX-License-Identifier: Apache-2.0
// The calls of services: each service processes one call, and further calls wait in the order of their arrival. A
// frame does not contain its caller. With one call of a service in the hardware, its response, its errors and its
// time-out belong to that call. The same holds for the calls of the hardware. C++17, no dependencies.
//
// The behaviour equals that of fusesoc_firm/node/engine/calls.py.
#pragma once

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <firm/log.hpp>
#include <firm/transport.hpp>

namespace firm {

// A service that the hardware serves, or calls: the name of its block, the ids of the converters of its messages, its
// name in ROS, its type and signature, and the types of its messages. A call is answered within `limit`. `failure` is
// the response to a call that fails, if the response has a field `success`; otherwise, it is empty.
struct Service {
  std::string block;
  bool is_server;
  unsigned request;
  unsigned response;
  std::string name;
  std::string type;
  std::string signature;
  std::string request_type;
  std::string response_type;
  std::chrono::milliseconds limit;
  Bytes failure;
};

// The answer to a call: the payload of the response, or nothing if the call failed, for a reason.
struct Answer {
  std::optional<Bytes> payload;
  std::string reason{};
};

// Takes the answer to a call; any thread may call it.
using AnswerHandler = std::function<void(const Answer&)>;
// Takes a call; it answers each call once.
using CallHandler = std::function<void(Bytes payload, AnswerHandler answer)>;

// Takes an unexpected error of a thread, after which the node has to end; any thread may call it.
using FaultHandler = std::function<void(const std::string& reason)>;

// The calls of one service. Any thread may call the functions; the line's own thread hands calls over.
//
// A late answer that does not identify its call would be assigned to the next call. Therefore, if a call is not
// answered in time, or if more may follow its answer, the next call waits until more output or rest(), but for at most
// another `limit`, or `kLeastWait` if this is longer.
//
// The hardware receives the answers to its calls in their order, and from the line's thread: the thread that receives
// calls from the hardware must not wait until the hardware takes an answer.
class CallLine {
 public:
  using HandOver = std::function<void(const Bytes& payload, std::uint64_t number)>;

  static constexpr std::size_t kMostWaiting = 1000;
  static constexpr std::chrono::seconds kLeastWait{2};

  // Answers to calls of the hardware (`from_hardware`) identify their call. An exception in the line's thread is
  // passed to `on_fault`.
  CallLine(std::chrono::nanoseconds limit, bool from_hardware, HandOver hand_over, FaultHandler on_fault)
      : limit_(limit),
        from_hardware_(from_hardware),
        hand_over_(std::move(hand_over)),
        on_fault_(std::move(on_fault)),
        thread_([this] { run_guarded(); }) {}

  ~CallLine() {
    close();
    thread_.join();
  }

  CallLine(const CallLine&) = delete;
  CallLine& operator=(const CallLine&) = delete;

  // Add a call; it fails if too many calls wait, or if the node ends.
  void put(Bytes payload, AnswerHandler answer) {
    const Answer refusal{std::nullopt, "too many calls wait, or the node ends"};
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      const bool is_refused = is_ending_ || waiting_.size() >= kMostWaiting;
      // A call of the hardware that is refused keeps its turn.
      if (!is_refused || (from_hardware_ && !has_ended_)) {
        waiting_.push_back({std::move(payload), std::move(answer), is_refused ? std::optional(refusal) : std::nullopt});
        changed_.notify_all();
        return;
      }
    }
    answer(refusal);
  }

  // Answer the current call, if it has this number; return whether it has. Unless `is_final`, more may follow from the
  // hardware for this call.
  bool settle(Answer answer, std::optional<std::uint64_t> number = std::nullopt, bool is_final = true) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!is_held_ || answer_ || (number && *number != number_)) return false;
    answer_ = std::move(answer);
    is_final_ = is_final;
    changed_.notify_all();
    return true;
  }

  // Restart the `limit` of the current call.
  void extend() {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_extended_ = true;
    changed_.notify_all();
  }

  // Record that nothing more follows from the hardware for an abandoned call.
  void rest() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!is_late_) return;
    answer_ = Answer{};
    changed_.notify_all();
  }

  // Stop taking calls, and wait until all are answered, or until this time.
  void drain(std::chrono::steady_clock::time_point latest) {
    std::unique_lock<std::mutex> lock(mutex_);
    is_ending_ = true;
    changed_.wait_until(lock, latest, [this] { return !is_held_ && waiting_.empty(); });
  }

  // Let all open calls fail.
  void close() {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_ending_ = is_closed_ = true;
    changed_.notify_all();
  }

 private:
  struct Call {
    Bytes payload;
    AnswerHandler answer;
    std::optional<Answer> refusal;
  };

  void run_guarded() {
    try {
      run();
    } catch (const std::exception& error) {
      {
        // No thread waits for this thread any more.
        const std::lock_guard<std::mutex> lock(mutex_);
        is_ending_ = is_closed_ = has_ended_ = true;
        is_held_ = false;
        waiting_.clear();
        changed_.notify_all();
      }
      on_fault_(error.what());
    }
  }

  void run() {
    const Answer ended{std::nullopt, "the node ends"};
    while (const auto call = next()) {
      if (call->refusal || is_closed()) {
        call->answer(call->refusal.value_or(ended));
        continue;
      }
      hand_over_(call->payload, number_);
      const auto answer = wait();
      call->answer(answer ? *answer : is_closed() ? ended : Answer{std::nullopt, no_answer()});
      wait_for_late();
    }
  }

  // Return the next call, or nothing if the line is closed and empty.
  std::optional<Call> next() {
    std::unique_lock<std::mutex> lock(mutex_);
    answer_.reset();
    is_held_ = is_late_ = false;
    changed_.notify_all();
    changed_.wait(lock, [this] { return is_closed_ || !waiting_.empty(); });
    if (waiting_.empty()) {
      has_ended_ = true;
      return std::nullopt;
    }
    std::optional<Call> call(std::move(waiting_.front()));
    waiting_.pop_front();
    is_held_ = true;
    ++number_;
    return call;
  }

  // Return the answer to the current call, or nothing if it does not arrive in time or the line is closed.
  std::optional<Answer> wait() {
    std::unique_lock<std::mutex> lock(mutex_);
    is_extended_ = true;
    while (is_extended_ && !is_closed_ && !answer_) {
      is_extended_ = false;
      changed_.wait_for(lock, limit_, [this] { return is_closed_ || answer_ || is_extended_; });
    }
    return answer_;
  }

  // Wait for late output of the hardware for the current call.
  void wait_for_late() {
    std::unique_lock<std::mutex> lock(mutex_);
    if (from_hardware_ || (answer_ && is_final_)) return;
    answer_.reset();
    is_late_ = true;
    changed_.wait_for(lock, std::max<std::chrono::nanoseconds>(limit_, kLeastWait),
                      [this] { return is_closed_ || answer_; });
  }

  bool is_closed() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return is_closed_;
  }

  std::string no_answer() const {
    const auto milliseconds = std::chrono::duration_cast<std::chrono::milliseconds>(limit_).count();
    return "no answer within " + std::to_string(milliseconds) + " ms";
  }

  const std::chrono::nanoseconds limit_;
  const bool from_hardware_;
  const HandOver hand_over_;
  const FaultHandler on_fault_;
  mutable std::mutex mutex_;  // protects the members below
  std::condition_variable changed_;
  std::deque<Call> waiting_;
  bool is_held_ = false;
  std::uint64_t number_ = 0;  // of the current call; written by the line's thread only
  std::optional<Answer> answer_;
  bool is_final_ = false;
  bool is_late_ = false;
  bool is_extended_ = false;
  bool is_ending_ = false;
  bool is_closed_ = false;
  bool has_ended_ = false;
  std::thread thread_;  // the last member, as it uses the others
};

struct CallStatistics {
  std::uint64_t called = 0;
  std::uint64_t answered = 0;
  std::uint64_t failed = 0;
  std::uint64_t unasked = 0;  // responses of the hardware without a call
};

// The calls of all services of a node, between the middleware and the hardware. Any thread may call the functions.
class NodeCalls {
 public:
  // Sends a payload to a subscriber of the hardware; returns whether it will be sent, and may throw.
  using Put = std::function<bool(unsigned subscriber, const std::uint8_t* payload, std::size_t size)>;

  // `tells_failures`: the middleware has an answer for a call that fails.
  NodeCalls(std::vector<Service> services, bool tells_failures, Put put, const FaultHandler& on_fault)
      : services_(std::move(services)),
        tells_failures_(tells_failures),
        put_(std::move(put)),
        statistics_(services_.size()) {
    for (const auto& service : services_) {
      (service.is_server ? responses_ : requests_)[service.is_server ? service.response : service.request] =
          lines_.size();
      lines_.push_back(std::make_unique<CallLine>(
          service.limit, !service.is_server,
          [this, index = lines_.size()](const Bytes& payload, std::uint64_t number) { hand_over(index, payload, number); },
          on_fault));
    }
    callers_.resize(services_.size());
  }

  // Serve all servers with a middleware, and call its services for all clients.
  template <typename Ros>
  void connect(Ros& ros) {
    for (std::size_t index = 0; index < services_.size(); ++index) {
      if (services_[index].is_server) {
        ros.serve(services_[index], [this, index](Bytes payload, AnswerHandler answer) {
          put(index, std::move(payload),
              [this, index, answer](const Answer& found) { answer(to_client(index, found)); });
        });
      } else {
        CallHandler caller = ros.caller(services_[index]);
        const std::lock_guard<std::mutex> lock(mutex_);
        callers_[index] = std::move(caller);
      }
    }
  }

  // Take a message of the hardware's publisher, if it belongs to a service; return whether it does.
  bool take(unsigned publisher, const std::uint8_t* payload, std::size_t size) {
    if (const auto found = responses_.find(publisher); found != responses_.end()) {
      if (lines_[found->second]->settle({Bytes(payload, payload + size)})) return true;
      count(found->second, &CallStatistics::unasked);
      report("the hardware sent a response of " + services_[found->second].name + " to no call");
      return true;
    }
    const auto found = requests_.find(publisher);
    if (found == requests_.end()) return false;
    put(found->second, Bytes(payload, payload + size),
        [this, index = found->second](const Answer& answer) { to_hardware(index, answer); });
    return true;
  }

  // The hardware rejected a frame of this subscriber; an aborted response may follow.
  void refuse_request(unsigned subscriber) {
    for (std::size_t index = 0; index < services_.size(); ++index) {
      if (!services_[index].is_server || services_[index].request != subscriber) continue;
      lines_[index]->settle({std::nullopt, "the hardware rejected the request"}, std::nullopt, false);
    }
  }

  // The hardware ended a frame of this publisher in the middle.
  void refuse_response(unsigned publisher) {
    const auto found = responses_.find(publisher);
    if (found != responses_.end()) lines_[found->second]->settle({std::nullopt, "the hardware aborted the response"});
  }

  // The hardware was restarted, and has lost its calls.
  void forget() {
    for (const auto& [publisher, index] : responses_) {
      lines_[index]->settle({std::nullopt, "the hardware was restarted"});
    }
  }

  // The hardware has no work.
  void rest() {
    for (const auto& line : lines_) line->rest();
  }

  // Stop taking calls, and wait until all are answered, or for `longest`; then let the others fail.
  void drain(std::chrono::nanoseconds longest) {
    const auto latest = std::chrono::steady_clock::now() + longest;
    for (const auto& line : lines_) line->drain(latest);
    for (const auto& line : lines_) line->close();
  }

  // Return the counts of each service, in their order.
  std::vector<CallStatistics> statistics() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return statistics_;
  }

 private:
  static constexpr unsigned kMostReports = 20;

  void put(std::size_t index, Bytes payload, AnswerHandler answer) {
    count(index, &CallStatistics::called);
    lines_[index]->put(std::move(payload), std::move(answer));
  }

  void hand_over(std::size_t index, const Bytes& payload, std::uint64_t number) {
    if (services_[index].is_server) {
      const std::string fault = sent(services_[index].request, payload);
      if (!fault.empty()) lines_[index]->settle({std::nullopt, fault});
      return;
    }
    CallHandler call;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      call = callers_[index];
    }
    const auto settle = [this, index, number](const Answer& answer) { lines_[index]->settle(answer, number); };
    if (call) {
      call(payload, settle);
    } else {
      settle({std::nullopt, "the node is not connected yet"});
    }
  }

  // Return the answer that a client receives: ROS 2 has no answer for a call that fails.
  Answer to_client(std::size_t index, const Answer& answer) {
    if (!counted(index, answer) || tells_failures_ || services_[index].failure.empty()) return answer;
    return {services_[index].failure};
  }

  void to_hardware(std::size_t index, const Answer& answer) {
    const Bytes& failure = services_[index].failure;
    const bool has_failed = counted(index, answer);
    if (has_failed && failure.empty()) return;
    const std::string fault = sent(services_[index].response, has_failed ? failure : *answer.payload);
    if (!fault.empty()) report("a response of " + services_[index].name + " is not sent: " + fault);
  }

  // Send a payload to the hardware; return the reason if it is not sent.
  std::string sent(unsigned subscriber, const Bytes& payload) {
    try {
      return put_(subscriber, payload.data(), payload.size()) ? "" : "the node ends";
    } catch (const std::exception& error) {
      return error.what();
    }
  }

  // Count an answer, and report a failure; return whether the call failed.
  bool counted(std::size_t index, const Answer& answer) {
    count(index, answer.payload ? &CallStatistics::answered : &CallStatistics::failed);
    if (answer.payload) return false;
    const auto& service = services_[index];
    const bool is_told = !service.failure.empty() || (service.is_server && tells_failures_);
    report("a call of " + service.name + " failed" + (is_told ? "" : ", and gets no response") + ": " + answer.reason);
    return true;
  }

  void count(std::size_t index, std::uint64_t CallStatistics::*what) {
    const std::lock_guard<std::mutex> lock(mutex_);
    ++(statistics_[index].*what);
  }

  void report(const std::string& text) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (reported_++ < kMostReports) node_log().say(Level::kWarning, text);
  }

  const std::vector<Service> services_;
  const bool tells_failures_;
  const Put put_;
  std::map<unsigned, std::size_t> responses_;  // the service of each publisher with responses
  std::map<unsigned, std::size_t> requests_;   // the service of each publisher with requests
  mutable std::mutex mutex_;                   // protects the members below
  std::vector<CallStatistics> statistics_;
  unsigned reported_ = 0;
  std::vector<CallHandler> callers_;
  std::vector<std::unique_ptr<CallLine>> lines_;  // the last member, as their threads use the others
};

}  // namespace firm
