// SPDX-License-Identifier: Apache-2.0
// Actions that the hardware serves: it has one goal of an action at a time, further goals wait in their order. Clients
// send goals, cancel them and ask for results; the hardware sees only its current goal. C++17, no dependencies.
//
// The behaviour equals that of fusesoc_firm/node/actions/action_server.py.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <iterator>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <firm/action.hpp>
#include <firm/action_messages.hpp>
#include <firm/log.hpp>
#include <firm/services.hpp>

namespace firm {

// The goals of one action; any thread may call the functions. A goal is accepted at the hardware's first feedback or
// result, at the latest after `accept_limit`. If it fails before, it is rejected, and otherwise aborted.
class ActionServer {
 public:
  using Time = std::chrono::steady_clock::time_point;

  // The maximum number of ended goals of an action, with their results (ROS 2) or only their states (ROS 1), and of
  // clients that wait for the result of one goal. A client of actionlib gives up a goal whose end it has not seen, so
  // in ROS 1 the number of ended goals equals the number that may wait.
  static constexpr std::size_t kMostKept = 100;
  static constexpr std::size_t kMostKeptRos1 = 1000;
  static constexpr std::size_t kMostAskers = 100;
  // Early cancellations of actionlib: those of goals that have not arrived yet.
  static constexpr std::size_t kMostEarly = 100;

  // `is_first`: the action is one of ROS 1.
  ActionServer(const Action& action, bool is_first, PutPayload put, FaultHandler on_fault)
      : action_(action),
        is_first_(is_first),
        put_(std::move(put)),
        line_(action.limit, false, [this](const Bytes& key, std::uint64_t) { hand_over(key); }, std::move(on_fault)) {}

  ActionServer(const ActionServer&) = delete;
  ActionServer& operator=(const ActionServer&) = delete;

  // Begin to publish goals to clients; no goal may arrive earlier.
  void start(std::vector<PublishBytes> publishers) {
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
    // A client of actionlib gives up a goal that it cancels before it receives its state.
    if (has_news_) publish_states();
    try {
      publish(Action::kFeedback, messages().feedback(current_->status(), payload));
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

  static constexpr std::chrono::milliseconds kStatesInterval{200};
  // In ROS 1, changes within this time are published together, since each message has all goals.
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

  // Return whether a cancellation concerns a goal.
  bool is_meant(const Goal& goal, const GoalReference& wanted) const {
    return !has_ended(goal.state) && (goal.is_accepted || is_first_) && wanted.means(goal.reference);
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
          // The time limit restarts: the hardware does not have the cancellation yet.
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
    statistics_.count(state);
    if (is_first_) {
      publish(Action::kResult, goal->result);
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
    publish(Action::kStates, messages().states(known));
  }

  void take_unasked(const std::string& what) {
    ++statistics_.unasked;
    report("the hardware sent " + what + " of " + action_.name + " for no goal");
  }

  void report(const std::string& text) {
    const Lock lock(mutex_);
    if (reported_++ < kMostReports) node_log().say(Level::kWarning, text);
  }

  const Action action_;
  const bool is_first_;
  const PutPayload put_;
  std::mutex sending_;  // keeps a goal before its cancellation
  mutable std::recursive_mutex mutex_;  // protects the members below
  Ros1ActionMessages ros1_;
  Ros2ActionMessages ros2_;
  std::vector<PublishBytes> publishers_;
  std::uint64_t number_ = 0;
  std::list<std::shared_ptr<Goal>> goals_;                   // all that clients may use, in their order
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

}  // namespace firm
