// SPDX-License-Identifier: Apache-2.0
// Sends goals of the hardware to actions of other nodes: the server has one goal at a time, in their order. Each goal
// ends with exactly one result. The node gives each goal a new unique id for the server, and replaces it by the
// hardware's own id in messages to the hardware. C++17, no dependencies.
//
// The behaviour equals that of fusesoc_firm/node/actions/action_client.py.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <firm/action.hpp>
#include <firm/action_messages.hpp>
#include <firm/log.hpp>
#include <firm/services.hpp>

namespace firm {

// The goals of the hardware for one action; any thread may call the functions. A goal is sent until the server reports
// it, in ROS 1 not before the server has published states. It is lost if the server does not report it for the time
// limit, and then canceled, since the server may still pursue it.
class ActionClient {
 public:
  // `is_first`: the action is one of ROS 1.
  ActionClient(const Action& action, bool is_first, PutPayload put, FaultHandler on_fault)
      : action_(action),
        is_first_(is_first),
        put_(std::move(put)),
        line_(action.limit, true,
              [this](const Bytes& key, std::uint64_t number) { hand_over(key_of(key), number); },
              std::move(on_fault)) {}

  ActionClient(const ActionClient&) = delete;
  ActionClient& operator=(const ActionClient&) = delete;

  // Begin to send goals, by the publishers of ROS 1 or the services of ROS 2.
  void start(std::vector<PublishBytes> publishers, std::vector<CallHandler> services) {
    const Lock lock(mutex_);
    publishers_ = std::move(publishers);
    services_ = std::move(services);
  }

  // --- from the hardware ---

  void take_goal(const Bytes& payload) {
    auto goal = std::make_shared<Goal>();
    std::uint64_t key = 0;
    try {
      const Lock lock(mutex_);
      goal->own = messages().goal(payload);
      goal->sent = {new_id(), stamp_of_now()};
      goal->payload = messages().renamed(payload, goal->sent);
      goal->is_canceled = is_ending_;
      key = ++last_key_;
      goals_[key] = goal;
      ++statistics_.goals;
    } catch (const MessageError& error) {
      return report("a goal of " + action_.name + " is ignored: " + error.what());
    }
    Bytes bytes;
    put_number(bytes, static_cast<std::uint32_t>(key));
    put_number(bytes, static_cast<std::uint32_t>(key >> 32));
    line_.put(std::move(bytes), [this, key](const Answer& answer) { handed_back(key, answer); });
  }

  void take_cancel(const Bytes& payload) {
    try {
      cancel(messages().cancellation(payload));
    } catch (const MessageError& error) {
      report("a cancellation of " + action_.name + " is ignored: " + error.what());
    }
  }

  // The hardware was restarted: its earlier goals are unknown to it, and it receives no results.
  void forget() {
    const Lock lock(mutex_);
    for (const auto& [key, goal] : goals_) goal->is_forgotten = true;
    cancel({});
  }

  // --- from the server ---

  // Functions throw MessageError.
  void take_states(const Bytes& payload) {
    const Lock lock(mutex_);
    heard_ = std::chrono::steady_clock::now();
    if (current_ && messages().listed(payload).count(current_->sent.id) > 0) told(*current_);
  }

  void take_feedback(const Bytes& payload) {
    const auto goal = named(payload);
    if (!goal) return;
    const Bytes renamed = messages().renamed(payload, goal->own);
    const std::lock_guard<std::mutex> sending(sending_);
    const bool is_current = [&] {
      const Lock lock(mutex_);
      return goal == current_ && !goal->is_forgotten;
    }();
    if (is_current) send(action_.feedback, renamed);
  }

  // Take a result of ROS 1.
  void take_result(const Bytes& payload) {
    if (const auto goal = named(payload)) finish(*goal, messages().renamed(payload, goal->own));
  }

  // --- times ---

  // Repeat messages that the server has not received; to be called several times a second.
  void tick() {
    const Lock lock(mutex_);
    if (current_) repeat(current_);
  }

  // Cancel all goals, and those that follow, since the node ends.
  void give_up() {
    const Lock lock(mutex_);
    is_ending_ = true;
    cancel({});
    // A server of actionlib keeps the cancellation of a goal that has not arrived.
    const bool was_published = is_first_ && current_ && current_->tried != Time{};
    if (was_published && !current_->cancel_was_sent) give_up(current_);
  }

  // Wait for the answer of a server of ROS 2 that has a goal and may not have accepted it yet, until this time.
  void wait_until_canceled(std::chrono::steady_clock::time_point latest) {
    std::unique_lock<std::recursive_mutex> lock(mutex_);
    progress_.wait_until(lock, latest, [this] { return !current_ || !is_being_sent(*current_); });
  }

  // Let all goals end.
  void close() { line_.close(); }

  GoalStatistics statistics() const {
    const Lock lock(mutex_);
    return statistics_;
  }

  const Action& action() const { return action_; }

 private:
  using Lock = std::lock_guard<std::recursive_mutex>;
  using Time = std::chrono::steady_clock::time_point;

  static constexpr std::chrono::milliseconds kAgain{500};
  // A server of actionlib that has published no states for this time is missing.
  static constexpr std::chrono::seconds kHeard{2};
  static constexpr unsigned kMostReports = 20;

  // A call of a goal (ROS 2): the number of the last attempt, and the time of the next one if that has failed.
  struct Request {
    Bytes payload;
    std::uint64_t number;
    std::optional<Time> again{};
  };

  // A goal: the number of its call in the line, the id of the hardware, and the id for the server. If `is_known`, the
  // server has reported the goal. `fault` is the reason for the last attempt that failed.
  struct Goal {
    std::uint64_t number = 0;
    GoalReference own;
    GoalReference sent;
    Bytes payload;
    GoalState state = GoalState::kWaiting;
    bool was_sent = false;
    bool is_known = false;
    bool is_canceled = false;
    bool cancel_was_sent = false;
    bool is_forgotten = false;
    bool has_ended = false;
    Time tried{};
    std::string fault;
    std::map<std::size_t, Request> requests;

    // The goal in cancellations of the hardware; without a time, that of its arrival counts.
    GoalReference named() const { return {own.id, own.stamp.is_zero() ? sent.stamp : own.stamp}; }
  };
  using GoalPointer = std::shared_ptr<Goal>;

  ActionMessages& messages() { return is_first_ ? static_cast<ActionMessages&>(ros1_) : ros2_; }

  static std::uint64_t key_of(const Bytes& bytes) {
    MessageReader reader(bytes);
    const std::uint64_t low = reader.number();
    return low | static_cast<std::uint64_t>(reader.number()) << 32;
  }

  // Return a random id: a text of ROS 1, or a UUID.
  std::string new_id() {
    constexpr unsigned kBytes = 16;
    constexpr char kDigits[] = "0123456789abcdef";
    std::string bytes, digits = action_.block + "-";
    for (unsigned index = 0; index < kBytes; ++index) {
      const unsigned byte = random_() & 0xff;
      bytes += static_cast<char>(byte);
      digits += {kDigits[byte >> 4], kDigits[byte & 0xf]};
    }
    return is_first_ ? digits : bytes;
  }

  void hand_over(std::uint64_t key, std::uint64_t number) {
    {
      const Lock lock(mutex_);
      const GoalPointer goal = goals_.at(key);
      goal->number = number;
      if (!goal->is_canceled) {
        current_ = goal;
        goal->was_sent = true;
        begin(goal);
        return;
      }
      settle(*goal, GoalState::kCanceled);
    }
  }

  // Return the goal of the hardware that feedback or a result of ROS 1 concerns; others belong to other clients.
  GoalPointer named(const Bytes& payload) {
    const std::string id = messages().goal(payload).id;
    const Lock lock(mutex_);
    if (!current_ || current_->sent.id != id) return nullptr;
    told(*current_);
    return current_;
  }

  // Record that the server has reported a goal.
  void told(Goal& goal) {
    goal.is_known = true;
    goal.fault.clear();
    line_.extend();
  }

  // Take the result for the hardware. Throws MessageError.
  void finish(Goal& goal, const Bytes& payload) { settle(goal, messages().state(payload), payload); }

  // Let a goal end with a state, unless it has ended; without a payload, the node makes the result.
  void settle(Goal& goal, GoalState state, const Bytes& payload = {}) {
    const Lock lock(mutex_);
    // The line returns the goal when the mutex is free.
    if (!goal.has_ended && line_.settle({payload}, goal.number)) goal.state = state;
  }

  void handed_back(std::uint64_t key, const Answer& answer) {
    GoalPointer goal;
    Bytes result;
    {
      const Lock lock(mutex_);
      goal = goals_.at(key);
      goals_.erase(key);
      goal->has_ended = true;
      progress_.notify_all();
      if (current_ == goal) current_ = nullptr;
      const std::string reason = goal->fault.empty() ? answer.reason : answer.reason + ": " + goal->fault;
      if (!answer.payload) {
        goal->state = GoalState::kLost;
        report("a goal of " + action_.name + " is lost: " + reason);
        if (goal->was_sent && !goal->cancel_was_sent) give_up(goal);
      }
      statistics_.count(goal->state);
      const GoalStatus status{goal->own, goal->state, goal->was_sent, reason};
      const bool has_result = answer.payload && !answer.payload->empty();
      result = has_result ? *answer.payload : messages().result(status, action_.no_result);
    }
    if (goal->is_forgotten) return;
    const std::lock_guard<std::mutex> sending(sending_);
    send(action_.result, result);
  }

  // Send a payload to the hardware.
  void send(unsigned subscriber, const Bytes& payload) {
    try {
      put_(subscriber, payload.data(), payload.size());
    } catch (const std::exception& error) {
      report("a message of " + action_.name + " is not sent: " + error.what());
    }
  }

  // --- with the mutex ---

  // Cancel goals; one that waits ends when it would have been sent.
  void cancel(const GoalReference& wanted) {
    const Lock lock(mutex_);
    for (const auto& [key, goal] : goals_) {
      if (goal->is_canceled || !wanted.means(goal->named())) continue;
      goal->is_canceled = true;
      if (goal != current_) continue;
      // The time limit restarts: the server does not have the cancellation yet.
      line_.extend();
      cancel_current(goal);
    }
  }

  void begin(const GoalPointer& goal) {
    if (!is_first_) return request(goal, Action::kSendGoal, goal->payload);
    goal->fault = "no server has told of it";
    repeat(goal);
  }

  void repeat(const GoalPointer& goal) {
    const auto now = std::chrono::steady_clock::now();
    if (!is_first_) {
      const auto requests = goal->requests;
      for (const auto& [service, made] : requests) {
        if (made.again && now >= *made.again) request(goal, service, made.payload);
      }
    } else if (!goal->is_known) {
      if (now - goal->tried < kAgain || now - heard_ > kHeard) return;
      // Servers ignore a goal that they already have.
      goal->tried = now;
      publish(Action::kGoal, goal->payload);
    } else if (goal->is_canceled && !goal->cancel_was_sent) {
      give_up(goal);
    }
  }

  // Cancel the goal that the server has, as soon as the server knows it.
  void cancel_current(const GoalPointer& goal) {
    if (is_first_ ? goal->is_known : goal->requests.count(Action::kGetResult) > 0) give_up(goal);
  }

  // Return whether the goal can be canceled only after an answer.
  static bool is_being_sent(const Goal& goal) {
    const auto send = goal.requests.find(Action::kSendGoal);
    return send != goal.requests.end() && !send->second.again && goal.requests.count(Action::kGetResult) == 0;
  }

  void give_up(const GoalPointer& goal) {
    goal->cancel_was_sent = true;
    // Without a time, which would cancel all earlier goals.
    const Bytes payload = messages().cancel({goal->sent.id});
    if (is_first_) {
      publish(Action::kCancel, payload);
    } else {
      request(goal, Action::kCancelGoal, payload);
    }
  }

  void publish(std::size_t number, const Bytes& payload) {
    try {
      if (number < publishers_.size()) publishers_[number](payload);
    } catch (const std::exception& error) {
      report(error.what());
    }
  }

  void request(const GoalPointer& goal, std::size_t service, const Bytes& payload) {
    const std::uint64_t number = ++last_request_;
    goal->requests[service] = {payload, number};
    const auto take = [this, goal, service, number](const Answer& answer) { answered(goal, service, number, answer); };
    if (service < services_.size()) {
      services_[service](payload, take);
    } else {
      take({std::nullopt, "the node is not connected yet"});
    }
  }

  void answered(const GoalPointer& goal, std::size_t service, std::uint64_t number, const Answer& answer) {
    const Lock lock(mutex_);
    progress_.notify_all();
    Request& made = goal->requests[service];
    if (made.number != number) return;
    try {
      if (goal != current_) {
        // A goal that is lost may be accepted late.
        const bool is_late = service == Action::kSendGoal && goal->state == GoalState::kLost && answer.payload;
        if (is_late && Ros2ActionMessages::is_accepted(*answer.payload)) give_up(goal);
      } else if (!answer.payload) {
        made.again = std::chrono::steady_clock::now() + kAgain;
        goal->fault = answer.reason;
      } else {
        told(*goal);
        take_answer(goal, service, *answer.payload);
      }
    } catch (const MessageError& error) {
      report("an answer about a goal of " + action_.name + " is ignored: " + error.what());
    }
  }

  void take_answer(const GoalPointer& goal, std::size_t service, const Bytes& payload) {
    if (service == Action::kSendGoal) {
      if (Ros2ActionMessages::is_accepted(payload)) {
        request(goal, Action::kGetResult, Ros2ActionMessages::request(goal->sent));
        if (goal->is_canceled) cancel_current(goal);
      } else {
        settle(*goal, GoalState::kRejected);
      }
    } else if (service == Action::kGetResult) {
      if (Ros2ActionMessages::is_unknown(payload)) {
        line_.settle({std::nullopt, "the server does not know it"}, goal->number);
      } else {
        finish(*goal, payload);
      }
    }
  }

  void report(const std::string& text) {
    const Lock lock(mutex_);
    if (reported_++ < kMostReports) node_log().say(Level::kWarning, text);
  }

  const Action action_;
  const bool is_first_;
  const PutPayload put_;
  std::mutex sending_;  // keeps feedback before its result
  mutable std::recursive_mutex mutex_;  // protects the members below
  Ros1ActionMessages ros1_;
  Ros2ActionMessages ros2_;
  std::random_device random_;
  std::vector<PublishBytes> publishers_;
  std::vector<CallHandler> services_;
  std::uint64_t last_key_ = 0;
  std::uint64_t last_request_ = 0;
  std::map<std::uint64_t, GoalPointer> goals_;  // not ended, in their order
  GoalPointer current_;                         // the one that the server has
  bool is_ending_ = false;
  Time heard_{};  // the last states
  GoalStatistics statistics_;
  unsigned reported_ = 0;
  std::condition_variable_any progress_;  // of the current goal
  CallLine line_;  // the last member, as its thread uses the others
};

}  // namespace firm
