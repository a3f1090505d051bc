// SPDX-License-Identifier: Apache-2.0
// The goals of actions: the hardware has one goal of an action at a time, further goals wait in their order. Clients send
// goals, cancel them and ask for results; the hardware only ever sees its goal. C++17, no dependencies.
//
// The behaviour equals that of fusesoc_firm/node/actions.py.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <iostream>
#include <iterator>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <firm/action_messages.hpp>
#include <firm/services.hpp>
#include <firm/topic.hpp>

namespace firm {

// An action that the hardware serves: the name of its block, the ids of the converters of its messages, its topics and
// services. The topics to the node are goals and cancellations (ROS 1), those from it are states, feedback and, in
// ROS 1, results. The services of ROS 2 are those of goals, cancellations and results. If the hardware sends nothing
// about its goal for `limit`, the goal fails; after `accept_limit`, it is accepted. `no_result` is the payload of a
// result without contents.
struct Action {
  std::string block;
  unsigned goal;
  unsigned cancel;
  unsigned feedback;
  unsigned result;
  std::string name;
  std::vector<Topic> subscribers;
  std::vector<Topic> publishers;
  std::vector<Service> services;
  std::chrono::milliseconds limit;
  std::chrono::milliseconds accept_limit;
  Bytes no_result;
};

struct GoalStatistics {
  std::uint64_t goals = 0;
  std::uint64_t succeeded = 0;
  std::uint64_t canceled = 0;
  std::uint64_t aborted = 0;
  std::uint64_t rejected = 0;
  std::uint64_t unasked = 0;  // feedback and results of the hardware without a goal
};

// The goals of one action; any thread may call the functions. A goal is accepted at the hardware's first feedback or
// result, at the latest after `accept_limit`. If it fails before, it is rejected, and otherwise aborted.
class ActionServer {
 public:
  using Put = std::function<bool(unsigned subscriber, const std::uint8_t* payload, std::size_t size)>;
  using Publish = std::function<void(const Bytes&)>;
  using Time = std::chrono::steady_clock::time_point;

  // The goals of an action that have ended, with their results (ROS 2) or only their states (ROS 1), and the clients that
  // wait for the result of one goal. A client of actionlib gives up a goal that it has not seen end, so in ROS 1 as
  // many are kept as may wait.
  static constexpr std::size_t kMostKept = 100;
  static constexpr std::size_t kMostKeptRos1 = 1000;
  static constexpr std::size_t kMostAskers = 100;
  // Early cancellations of actionlib: those of goals that have not arrived yet.
  static constexpr std::size_t kMostEarly = 100;

  // `is_first`: the action is one of ROS 1.
  ActionServer(const Action& action, bool is_first, Put put)
      : action_(action),
        is_first_(is_first),
        put_(std::move(put)),
        line_(action.limit, false, [this](const Bytes& key, std::uint64_t) { hand_over(key); }) {}

  ActionServer(const ActionServer&) = delete;
  ActionServer& operator=(const ActionServer&) = delete;

  // Begin to tell clients of goals; no goal may come earlier.
  void start(std::vector<Publish> publishers) {
    const Lock lock(mutex_);
    publishers_ = std::move(publishers);
    tell_states();
  }

  // --- from clients ---

  // Take a goal; `asker` receives the response of ROS 2.
  void add(const Bytes& payload, AnswerHandler asker = nullptr) {
    std::uint64_t number = 0;
    std::shared_ptr<Goal> goal;
    {
      const Lock lock(mutex_);
      goal = std::make_shared<Goal>();
      goal->reference = messages().goal(payload);
      goal->payload = payload;
      goal->asker = std::move(asker);
      number = ++number_;
      if (is_first_) complete(goal->reference);
      if (find(goal->reference.id)) {
        turn_down(*goal);
        return;
      }
      ++statistics_.goals;
      goals_.push_back(goal);
      waiting_[number] = goal;
      if (is_canceled(goal->reference)) {
        end(goal, GoalState::kCanceled);
      } else {
        tell_states();
      }
    }
    Bytes key;
    put_number(key, static_cast<std::uint32_t>(number));
    put_number(key, static_cast<std::uint32_t>(number >> 32));
    line_.put(std::move(key), [this, goal](const Answer& answer) { handed_back(goal, answer); });
  }

  // Take a cancellation of ROS 1.
  void cancel(const Bytes& payload) {
    const GoalReference wanted = messages().cancellation(payload);
    std::vector<GoalReference> found;
    const bool is_known = cancel_goals(wanted, found);
    const Lock lock(mutex_);
    if (canceled_until_ <= wanted.stamp) canceled_until_ = wanted.stamp;
    if (!wanted.has_id() || is_known) return;
    early_.push_back(wanted.id);
    if (early_.size() > kMostEarly) early_.pop_front();
  }

  // Take a cancellation of ROS 2.
  void cancel(const Bytes& payload, const AnswerHandler& asker) {
    constexpr std::uint8_t kNoError = 0, kUnknownGoal = 2, kEndedGoal = 3;
    const GoalReference wanted = messages().cancellation(payload);
    std::vector<GoalReference> found;
    const bool is_known = cancel_goals(wanted, found);
    const auto is_named = [&](const GoalReference& goal) { return goal.id == wanted.id; };
    const bool is_missing = wanted.has_id() && std::none_of(found.begin(), found.end(), is_named);
    const std::uint8_t code = !is_missing ? kNoError : is_known ? kEndedGoal : kUnknownGoal;
    asker({Ros2ActionMessages::canceling(code, found)});
  }

  // Take a request for a result (ROS 2).
  void ask(const Bytes& payload, AnswerHandler asker) {
    Bytes found;
    {
      const Lock lock(mutex_);
      const auto goal = find(Ros2ActionMessages::id_of(payload));
      if (goal && !has_ended(goal->state) && goal->askers.size() < kMostAskers) {
        goal->askers.push_back(std::move(asker));
        return;
      }
      found = goal && has_ended(goal->state) ? goal->result : Ros2ActionMessages::unknown(action_.no_result);
    }
    asker({found});
  }

  // --- to and from the hardware ---

  void take_feedback(const Bytes& payload) {
    const Lock lock(mutex_);
    if (!current_) return take_unasked("feedback");
    line_.extend();
    accept(current_);
    // A client of actionlib gives up a goal that it cancels before it knows its state.
    if (has_news_) publish_states();
    try {
      publish(kFeedback, messages().feedback(current_->status(), payload));
    } catch (const MessageError& error) {
      report("invalid feedback of " + action_.name + " is ignored: " + error.what());
    }
  }

  void take_result(const Bytes& payload) {
    if (line_.settle({payload})) return;
    const Lock lock(mutex_);
    take_unasked("a result");
  }

  // The hardware has a fault in its goal, after which a result may follow, or in its result.
  void refuse(const std::string& reason, bool is_final) { line_.settle({std::nullopt, reason}, std::nullopt, is_final); }
  // The hardware has no work.
  void rest() { line_.rest(); }
  // Take no more goals, and wait until all have ended, or until this time.
  void drain(Time latest) { line_.drain(latest); }
  // Let all goals fail that have not ended.
  void close() {
    line_.close();
    const Lock lock(mutex_);
    if (has_news_) publish_states();
  }

  // Accept goals in time, forget old results, and publish the states of ROS 1; to be called several times a second.
  void tick() {
    const Lock lock(mutex_);
    const auto now = std::chrono::steady_clock::now();
    for (const auto& goal : goals_) {
      const bool is_ready = goal->was_taken || !is_first_;
      if (is_ready && !has_ended(goal->state) && now - goal->changed > action_.accept_limit) accept(goal);
    }
    forget_old();
    if (is_first_ && (has_news_ || now - told_ > kStatesInterval)) publish_states();
  }

  GoalStatistics statistics() const {
    const Lock lock(mutex_);
    return statistics_;
  }

  const Action& action() const { return action_; }

 private:
  using Lock = std::lock_guard<std::recursive_mutex>;

  // The numbers of the publishers.
  static constexpr std::size_t kStates = 0, kFeedback = 1, kResult = 2;
  static constexpr std::chrono::milliseconds kStatesInterval{200};
  // In ROS 1, changes that follow sooner are published together, since each message has all goals.
  static constexpr std::chrono::milliseconds kTogether{20};
  static constexpr std::chrono::seconds kKeptRos1{5};  // actionlib's own
  static constexpr std::chrono::seconds kKeptRos2{60};
  static constexpr unsigned kMostReports = 20;

  // A goal; `asker` waits for its acceptance, `askers` wait for its result (ROS 2).
  struct Goal {
    GoalReference reference;
    Bytes payload;
    AnswerHandler asker;
    GoalState state = GoalState::kWaiting;
    bool is_accepted = false;
    bool was_taken = false;
    std::string text;
    Bytes result;
    Time changed = std::chrono::steady_clock::now();
    std::vector<AnswerHandler> askers;

    GoalStatus status() const { return {reference, state, was_taken, text}; }
  };

  ActionMessages& messages() { return is_first_ ? static_cast<ActionMessages&>(ros1_) : ros2_; }

  void publish(std::size_t number, const Bytes& payload) {
    try {
      if (number < publishers_.size()) publishers_[number](payload);
    } catch (const std::exception& error) {
      report(error.what());
    }
  }

  std::shared_ptr<Goal> find(const std::string& id) const {
    for (const auto& goal : goals_) {
      if (goal->reference.id == id) return goal;
    }
    return nullptr;
  }

  // Give a goal of ROS 1 an id and a time if it has none.
  void complete(GoalReference& reference) const {
    if (reference.stamp.is_zero()) reference.stamp = stamp_of_now();
    if (reference.id.empty()) reference.id = action_.name + "-" + std::to_string(number_);
  }

  bool is_canceled(const GoalReference& reference) {
    if (!is_first_) return false;
    const auto early = std::find(early_.begin(), early_.end(), reference.id);
    const bool is_early = early != early_.end();
    if (is_early) early_.erase(early);
    return is_early || reference.stamp <= canceled_until_;
  }

  // Reject a goal whose id is known; actionlib ignores it.
  void turn_down(const Goal& goal) {
    if (goal.asker) {
      goal.asker({Ros2ActionMessages::accepted(false, {})});
    } else {
      report("a goal of " + action_.name + " with a known id is ignored");
    }
  }

  // Return whether a cancellation concerns a goal: one by its id, all until a time, or all.
  bool is_meant(const Goal& goal, const GoalReference& wanted) const {
    if (has_ended(goal.state) || !(goal.is_accepted || is_first_)) return false;
    if (!wanted.has_id() && wanted.stamp.is_zero()) return true;
    return goal.reference.id == wanted.id || (!wanted.stamp.is_zero() && goal.reference.stamp <= wanted.stamp);
  }

  // Cancel goals; return whether the goal that the message names is known, and those that are being canceled.
  bool cancel_goals(const GoalReference& wanted, std::vector<GoalReference>& found) {
    std::vector<GoalReference> begun;
    bool is_known = false;
    {
      const Lock lock(mutex_);
      is_known = find(wanted.id) != nullptr;
      std::vector<std::shared_ptr<Goal>> meant;
      std::copy_if(goals_.begin(), goals_.end(), std::back_inserter(meant),
                   [&](const auto& goal) { return is_meant(*goal, wanted); });
      for (const auto& goal : meant) {
        found.push_back(goal->reference);
        if (!goal->was_taken) {
          end(goal, GoalState::kCanceled, {}, "the goal was canceled while it waited");
        } else if (goal->state != GoalState::kCanceling) {
          accept(goal);
          goal->state = GoalState::kCanceling;
          // The hardware has not been silent about a cancellation that it does not have yet.
          line_.extend();
          begun.push_back(goal->reference);
        }
      }
      tell_states();
    }
    for (const auto& goal : begun) send_cancel(goal);
    return is_known;
  }

  void hand_over(const Bytes& key) {
    MessageReader reader(key);
    const std::uint64_t low = reader.number();
    const std::uint64_t number = low | static_cast<std::uint64_t>(reader.number()) << 32;
    std::string fault;
    bool is_over = false;
    {
      const std::lock_guard<std::mutex> sending(sending_);
      std::shared_ptr<Goal> goal;
      {
        const Lock lock(mutex_);
        goal = waiting_.at(number);
        waiting_.erase(number);
        is_over = has_ended(goal->state);
        if (!is_over) {
          current_ = goal;
          goal->was_taken = true;
          goal->changed = std::chrono::steady_clock::now();
          if (goal->is_accepted) {
            goal->state = GoalState::kExecuting;
            tell_states();
          }
        }
      }
      if (!is_over) fault = sent(action_.goal, goal->payload);
    }
    if (is_over) {
      line_.settle({Bytes{}});
    } else if (!fault.empty()) {
      line_.settle({std::nullopt, fault});
    }
  }

  void handed_back(const std::shared_ptr<Goal>& goal, const Answer& answer) {
    {
      const Lock lock(mutex_);
      if (current_ == goal) current_ = nullptr;
      if (has_ended(goal->state)) return;
      if (answer.payload) {
        finish(goal, *answer.payload);
      } else {
        fail(goal, answer.reason);
      }
    }
    // The hardware may still work.
    if (!answer.payload && goal->was_taken) send_cancel(goal->reference);
  }

  void send_cancel(const GoalReference& goal) {
    const std::lock_guard<std::mutex> sending(sending_);
    const std::string fault = sent(action_.cancel, messages().cancel(goal));
    if (!fault.empty()) report("a cancellation of " + action_.name + " is not sent: " + fault);
  }

  // Send a payload to the hardware; return the reason if it is not sent.
  std::string sent(unsigned subscriber, const Bytes& payload) {
    try {
      return put_(subscriber, payload.data(), payload.size()) ? "" : "the node ends";
    } catch (const std::exception& error) {
      return error.what();
    }
  }

  // --- the states of a goal, with the mutex ---

  void accept(const std::shared_ptr<Goal>& goal) {
    if (goal->is_accepted) return;
    goal->is_accepted = true;
    if (goal->was_taken) goal->state = GoalState::kExecuting;
    if (!is_first_) {
      goal->reference.stamp = stamp_of_now();
      if (goal->asker) goal->asker({Ros2ActionMessages::accepted(true, goal->reference.stamp)});
    }
    tell_states();
  }

  void fail(const std::shared_ptr<Goal>& goal, const std::string& reason) {
    report("a goal of " + action_.name + " is " + (goal->is_accepted ? "aborted: " : "rejected: ") + reason);
    end(goal, goal->is_accepted ? GoalState::kAborted : GoalState::kRejected, {}, reason);
  }

  void finish(const std::shared_ptr<Goal>& goal, const Bytes& payload) {
    GoalState state = GoalState::kAborted;
    try {
      state = messages().state(payload);
    } catch (const MessageError& error) {
      return fail(goal, std::string("the hardware sent an invalid result: ") + error.what());
    }
    if (state == GoalState::kRejected && goal->is_accepted) state = GoalState::kAborted;
    if (state != GoalState::kRejected) accept(goal);
    end(goal, state, payload);
  }

  void end(const std::shared_ptr<Goal>& goal, GoalState state, const Bytes& payload = {}, const std::string& text = "") {
    goal->state = state;
    goal->text = text;
    goal->changed = std::chrono::steady_clock::now();
    goal->result = messages().result(goal->status(), payload.empty() ? action_.no_result : payload);
    ++(state == GoalState::kSucceeded  ? statistics_.succeeded
       : state == GoalState::kCanceled ? statistics_.canceled
       : state == GoalState::kAborted  ? statistics_.aborted
                                       : statistics_.rejected);
    if (is_first_) {
      publish(kResult, goal->result);
    } else {
      if (state == GoalState::kRejected) {
        goals_.remove(goal);
        turn_down(*goal);
      }
      for (const auto& asker : goal->askers) asker({goal->result});
      goal->askers.clear();
    }
    tell_states();
    forget_old();
  }

  void forget_old() {
    const auto kept = is_first_ ? kKeptRos1 : kKeptRos2;
    const auto most = is_first_ ? kMostKeptRos1 : kMostKept;
    const auto now = std::chrono::steady_clock::now();
    std::size_t count = 0;
    for (auto goal = goals_.end(); goal != goals_.begin();) {
      --goal;
      if (!has_ended((*goal)->state)) continue;
      if (++count > most || now - (*goal)->changed > kept) goal = goals_.erase(goal);
    }
  }

  void tell_states() {
    has_news_ = is_first_ && std::chrono::steady_clock::now() - told_ < kTogether;
    if (!has_news_) publish_states();
  }

  void publish_states() {
    has_news_ = false;
    std::vector<GoalStatus> known;
    for (const auto& goal : goals_) {
      if (goal->is_accepted || is_first_) known.push_back(goal->status());
    }
    told_ = std::chrono::steady_clock::now();
    publish(kStates, messages().states(known));
  }

  void take_unasked(const std::string& what) {
    ++statistics_.unasked;
    report("the hardware sent " + what + " of " + action_.name + " for no goal");
  }

  void report(const std::string& text) {
    const Lock lock(mutex_);
    if (reported_++ < kMostReports) std::cerr << text << std::endl;
  }

  const Action action_;
  const bool is_first_;
  const Put put_;
  std::mutex sending_;  // keeps a goal before its cancellation
  mutable std::recursive_mutex mutex_;  // protects the members below
  Ros1ActionMessages ros1_;
  Ros2ActionMessages ros2_;
  std::vector<Publish> publishers_;
  std::uint64_t number_ = 0;
  std::list<std::shared_ptr<Goal>> goals_;                   // all that clients may know, in their order
  std::map<std::uint64_t, std::shared_ptr<Goal>> waiting_;   // those in the line
  std::shared_ptr<Goal> current_;
  std::list<std::string> early_;
  Stamp canceled_until_;
  Time told_{};
  bool has_news_ = false;
  GoalStatistics statistics_;
  unsigned reported_ = 0;
  CallLine line_;  // the last member, as its thread uses the others
};

// The goals of all actions of a node, between the middleware and the hardware. Any thread may call the functions.
class NodeActions {
 public:
  NodeActions(const std::vector<Action>& actions, bool is_first, const ActionServer::Put& put) {
    for (const auto& action : actions) servers_.push_back(std::make_unique<ActionServer>(action, is_first, put));
  }

  // Serve all actions with a middleware.
  template <typename Ros>
  void connect(Ros& ros) {
    for (const auto& server : servers_) {
      const Action& action = server->action();
      std::vector<ActionServer::Publish> publishers;
      for (const auto& topic : action.publishers) {
        publishers.push_back([publish = ros.advertise(topic, topic.quality)](const Bytes& payload) {
          publish(payload.data(), payload.size());
        });
      }
      server->start(std::move(publishers));
      if constexpr (Ros::kVersion == 1) {
        subscribe(ros, *server);
      } else {
        serve(ros, *server);
      }
    }
  }

  // Take a message of the hardware's publisher, if it belongs to an action; return whether it does.
  bool take(unsigned publisher, const std::uint8_t* payload, std::size_t size) {
    for (const auto& server : servers_) {
      if (publisher == server->action().feedback) {
        server->take_feedback(Bytes(payload, payload + size));
        return true;
      }
      if (publisher == server->action().result) {
        server->take_result(Bytes(payload, payload + size));
        return true;
      }
    }
    return false;
  }

  // The hardware rejected a frame of this subscriber; an aborted result may follow.
  void refuse_goal(unsigned subscriber) {
    for (const auto& server : servers_) {
      if (server->action().goal == subscriber) server->refuse("the hardware rejected the goal", false);
    }
  }

  // The hardware ended a frame of this publisher in its middle.
  void refuse_result(unsigned publisher) {
    for (const auto& server : servers_) {
      if (server->action().result == publisher) server->refuse("the hardware aborted the result", true);
    }
  }

  // The hardware was restarted, and has forgotten its goals.
  void forget() {
    for (const auto& server : servers_) server->refuse("the hardware was restarted", true);
  }

  // The hardware has no work.
  void rest() {
    for (const auto& server : servers_) server->rest();
  }

  // To be called several times a second.
  void tick() {
    for (const auto& server : servers_) server->tick();
  }

  // Take no more goals, and wait until all have ended, or for `longest`; then let the others fail.
  void drain(std::chrono::nanoseconds longest) {
    const auto latest = std::chrono::steady_clock::now() + longest;
    for (const auto& server : servers_) server->drain(latest);
    for (const auto& server : servers_) server->close();
  }

  // Return the counts of each action, in their order.
  std::vector<GoalStatistics> statistics() const {
    std::vector<GoalStatistics> found;
    for (const auto& server : servers_) found.push_back(server->statistics());
    return found;
  }

 private:
  template <typename Ros>
  static void subscribe(Ros& ros, ActionServer& server) {
    const auto& topics = server.action().subscribers;
    constexpr std::size_t kGoal = 0, kCancel = 1;
    ros.subscribe(topics.at(kGoal), topics.at(kGoal).quality, guarded([&server](const Bytes& goal) { server.add(goal); }));
    ros.subscribe(topics.at(kCancel), topics.at(kCancel).quality,
                  guarded([&server](const Bytes& cancellation) { server.cancel(cancellation); }));
  }

  template <typename Ros>
  static void serve(Ros& ros, ActionServer& server) {
    const auto& services = server.action().services;
    constexpr std::size_t kSendGoal = 0, kCancelGoal = 1, kGetResult = 2;
    ros.serve(services.at(kSendGoal), [&server](const Bytes& payload, AnswerHandler asker) {
      server.add(payload, std::move(asker));
    });
    ros.serve(services.at(kCancelGoal), [&server](const Bytes& payload, const AnswerHandler& asker) {
      server.cancel(payload, asker);
    });
    ros.serve(services.at(kGetResult), [&server](const Bytes& payload, AnswerHandler asker) {
      server.ask(payload, std::move(asker));
    });
  }

  // Messages of ROS 1 are not checked before.
  static MessageHandler guarded(const std::function<void(const Bytes&)>& take) {
    return [take](const std::uint8_t* data, std::size_t size) {
      try {
        take(Bytes(data, data + size));
      } catch (const MessageError& error) {
        std::cerr << "a message of an action is ignored: " << error.what() << std::endl;
      }
    };
  }

  std::vector<std::unique_ptr<ActionServer>> servers_;
};

}  // namespace firm
