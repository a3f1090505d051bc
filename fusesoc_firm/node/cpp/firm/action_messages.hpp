// SPDX-License-Identifier: Apache-2.0
// The messages of actions as bytes, in both versions of ROS: ids, states, and the fields around feedback and results.
// C++17, no dependencies.
//
// The behaviour equals that of fusesoc_firm/node/actions/action_messages.py.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <set>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <firm/transport.hpp>

namespace firm {

// The state of a goal: waiting for the hardware, or after its end. kLost: the server of a goal of the hardware does
// not report its end.
enum class GoalState { kWaiting, kExecuting, kCanceling, kSucceeded, kCanceled, kAborted, kRejected, kLost };

inline bool has_ended(GoalState state) {
  return state != GoalState::kWaiting && state != GoalState::kExecuting && state != GoalState::kCanceling;
}

struct Stamp {
  std::uint32_t seconds = 0;
  std::uint32_t nanoseconds = 0;

  bool is_zero() const { return seconds == 0 && nanoseconds == 0; }
  bool operator<=(const Stamp& other) const {
    return std::tie(seconds, nanoseconds) <= std::tie(other.seconds, other.nanoseconds);
  }
};

inline Stamp stamp_of_now() {
  constexpr std::int64_t kSecond = 1'000'000'000;
  const auto since = std::chrono::system_clock::now().time_since_epoch();
  const std::int64_t count = std::chrono::duration_cast<std::chrono::nanoseconds>(since).count();
  return {static_cast<std::uint32_t>(count / kSecond), static_cast<std::uint32_t>(count % kSecond)};
}

// The goal that a message concerns: a UUID of ROS 2, or a text of ROS 1. Both values may be zero in a cancellation.
struct GoalReference {
  std::string id;
  Stamp stamp{};

  bool has_id() const { return id.find_first_not_of('\0') != std::string::npos; }

  // Return whether this cancellation concerns a goal: one by its id, all until a time, or all.
  bool means(const GoalReference& goal) const {
    if (!has_id() && stamp.is_zero()) return true;
    return (has_id() && goal.id == id) || (!stamp.is_zero() && goal.stamp <= stamp);
  }
};

// The state of a goal for all clients; `was_taken`: the hardware has received the goal.
struct GoalStatus {
  GoalReference goal;
  GoalState state;
  bool was_taken = true;
  std::string text{};
};

// A message is too short.
class MessageError : public std::runtime_error {
 public:
  MessageError() : std::runtime_error("the message is too short") {}
};

// Reads a message from its beginning. Functions throw MessageError.
class MessageReader {
 public:
  explicit MessageReader(const Bytes& bytes, std::size_t place = 0) : bytes_(bytes), place_(place) {}

  std::uint32_t number() {
    need(4);
    std::uint32_t value = 0;
    for (unsigned shift = 0; shift < 32; shift += 8) value |= static_cast<std::uint32_t>(bytes_[place_++]) << shift;
    return value;
  }

  std::uint8_t byte() {
    need(1);
    return bytes_[place_++];
  }

  std::string text(std::size_t size) {
    need(size);
    const auto begin = bytes_.begin() + static_cast<std::ptrdiff_t>(place_);
    place_ += size;
    return std::string(begin, begin + static_cast<std::ptrdiff_t>(size));
  }

  Stamp stamp() {
    const std::uint32_t seconds = number();
    return {seconds, number()};
  }

  std::size_t place() const { return place_; }

 private:
  void need(std::size_t size) const {
    if (size > bytes_.size() - place_) throw MessageError();
  }

  const Bytes& bytes_;
  std::size_t place_;
};

inline void put_number(Bytes& bytes, std::uint32_t value) {
  for (unsigned shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<std::uint8_t>(value >> shift));
}

inline void put_stamp(Bytes& bytes, const Stamp& stamp) {
  put_number(bytes, stamp.seconds);
  put_number(bytes, stamp.nanoseconds);
}

// The messages of a version of ROS. Functions that read throw MessageError.
class ActionMessages {
 public:
  virtual ~ActionMessages() = default;

  // Return the id and the stamp of a goal, or of the goal that feedback or a result of ROS 1 concerns.
  virtual GoalReference goal(const Bytes& payload) const = 0;
  // Return a goal, feedback or a result of ROS 1 with another id.
  virtual Bytes renamed(const Bytes& payload, const GoalReference& goal) const = 0;
  // Return the goals that a cancellation concerns.
  virtual GoalReference cancellation(const Bytes& payload) const = 0;
  // Return the cancellation of one goal, for the hardware.
  virtual Bytes cancel(const GoalReference& goal) const = 0;
  // Return the hardware's feedback, as feedback for a goal.
  virtual Bytes feedback(const GoalStatus& status, const Bytes& payload) = 0;
  // Return the state in the hardware's result; a state that does not end a goal counts as aborted.
  virtual GoalState state(const Bytes& payload) const = 0;
  // Return the hardware's result, as the result of a goal.
  virtual Bytes result(const GoalStatus& status, const Bytes& payload) = 0;
  // Return the states of all goals.
  virtual Bytes states(const std::vector<GoalStatus>& goals) = 0;
  // Return the ids of the goals whose states a message contains.
  virtual std::set<std::string> listed(const Bytes& payload) const = 0;
};

// The messages of actionlib (ROS 1).
class Ros1ActionMessages : public ActionMessages {
 public:
  GoalReference goal(const Bytes& payload) const override {
    MessageReader reader(payload);
    skip_header(reader);
    return goal_id(reader);
  }

  Bytes renamed(const Bytes& payload, const GoalReference& goal) const override {
    MessageReader reader(payload);
    skip_header(reader);
    Bytes bytes(payload.begin(), payload.begin() + static_cast<std::ptrdiff_t>(reader.place()));
    put_goal_id(bytes, goal);
    goal_id(reader);
    bytes.insert(bytes.end(), payload.begin() + static_cast<std::ptrdiff_t>(reader.place()), payload.end());
    return bytes;
  }

  GoalReference cancellation(const Bytes& payload) const override {
    MessageReader reader(payload);
    return goal_id(reader);
  }

  Bytes cancel(const GoalReference& goal) const override {
    Bytes bytes;
    put_goal_id(bytes, goal);
    return bytes;
  }

  Bytes feedback(const GoalStatus& status, const Bytes& payload) override {
    return joined(status, payload, parts_of(payload).end);
  }

  GoalState state(const Bytes& payload) const override {
    switch (parts_of(payload).state) {
      case kPreempted:
      case kRecalled: return GoalState::kCanceled;
      case 3: return GoalState::kSucceeded;
      case 5: return GoalState::kRejected;
      default: return GoalState::kAborted;
    }
  }

  Bytes result(const GoalStatus& status, const Bytes& payload) override {
    const Parts parts = parts_of(payload);
    GoalStatus told = status;
    if (!parts.text.empty()) told.text = parts.text;
    return joined(told, payload, parts.end);
  }

  Bytes states(const std::vector<GoalStatus>& goals) override {
    Bytes bytes = header();
    put_number(bytes, static_cast<std::uint32_t>(goals.size()));
    for (const auto& status : goals) put_status(bytes, status);
    return bytes;
  }

  std::set<std::string> listed(const Bytes& payload) const override {
    MessageReader reader(payload);
    skip_header(reader);
    std::set<std::string> found;
    for (std::uint32_t left = reader.number(); left > 0; --left) {
      found.insert(goal_id(reader).id);
      reader.byte();
      reader.text(reader.number());
    }
    return found;
  }

 private:
  static constexpr std::uint8_t kPreempted = 2, kRecalled = 8;

  // The state, its text and the place after both, of feedback or a result.
  struct Parts {
    std::uint8_t state;
    std::string text;
    std::size_t end;
  };

  static void skip_header(MessageReader& reader) {
    reader.text(12);
    reader.text(reader.number());
  }

  static GoalReference goal_id(MessageReader& reader) {
    const Stamp stamp = reader.stamp();
    return {reader.text(reader.number()), stamp};
  }

  static Parts parts_of(const Bytes& payload) {
    MessageReader reader(payload);
    skip_header(reader);
    goal_id(reader);
    const std::uint8_t state = reader.byte();
    std::string text = reader.text(reader.number());
    return {state, std::move(text), reader.place()};
  }

  static void put_text(Bytes& bytes, const std::string& text) {
    put_number(bytes, static_cast<std::uint32_t>(text.size()));
    bytes.insert(bytes.end(), text.begin(), text.end());
  }

  static void put_goal_id(Bytes& bytes, const GoalReference& goal) {
    put_stamp(bytes, goal.stamp);
    put_text(bytes, goal.id);
  }

  static std::uint8_t number_of(const GoalStatus& status) {
    switch (status.state) {
      case GoalState::kWaiting: return 0;
      case GoalState::kExecuting: return 1;
      case GoalState::kCanceling: return 6;
      case GoalState::kSucceeded: return 3;
      case GoalState::kCanceled: return status.was_taken ? kPreempted : kRecalled;
      case GoalState::kAborted: return 4;
      case GoalState::kRejected: return 5;
      case GoalState::kLost: return 9;
    }
    return 0;
  }

  static void put_status(Bytes& bytes, const GoalStatus& status) {
    put_goal_id(bytes, status.goal);
    bytes.push_back(number_of(status));
    put_text(bytes, status.text);
  }

  Bytes header() {
    Bytes bytes;
    put_number(bytes, ++count_);
    put_stamp(bytes, stamp_of_now());
    put_text(bytes, "");
    return bytes;
  }

  Bytes joined(const GoalStatus& status, const Bytes& payload, std::size_t end) {
    Bytes bytes = header();
    put_status(bytes, status);
    bytes.insert(bytes.end(), payload.begin() + static_cast<std::ptrdiff_t>(end), payload.end());
    return bytes;
  }

  std::uint32_t count_ = 0;
};

// The messages of actions in ROS 2, in CDR.
class Ros2ActionMessages : public ActionMessages {
 public:
  GoalReference goal(const Bytes& payload) const override { return {id_of(payload)}; }

  Bytes renamed(const Bytes& payload, const GoalReference& goal) const override {
    id_of(payload);
    Bytes bytes = payload;
    std::copy(goal.id.begin(), goal.id.end(), bytes.begin() + kIdPlace);
    return bytes;
  }

  GoalReference cancellation(const Bytes& payload) const override {
    MessageReader reader(payload, kIdPlace);
    std::string id = reader.text(kIdBytes);
    return {std::move(id), reader.stamp()};
  }

  Bytes cancel(const GoalReference& goal) const override {
    Bytes bytes = encoding();
    put_info(bytes, goal);
    return bytes;
  }

  Bytes feedback(const GoalStatus& status, const Bytes& payload) override { return renamed(payload, status.goal); }

  GoalState state(const Bytes& payload) const override {
    switch (MessageReader(payload, kStatePlace).byte()) {
      case 0: return GoalState::kRejected;
      case 4: return GoalState::kSucceeded;
      case 5: return GoalState::kCanceled;
      default: return GoalState::kAborted;
    }
  }

  Bytes result(const GoalStatus& status, const Bytes& payload) override {
    MessageReader(payload, kStatePlace).byte();
    Bytes bytes = payload;
    bytes[kStatePlace] = number_of(status.state);
    return bytes;
  }

  Bytes states(const std::vector<GoalStatus>& goals) override {
    Bytes bytes = encoding();
    put_number(bytes, static_cast<std::uint32_t>(goals.size()));
    for (const auto& status : goals) {
      bytes.insert(bytes.end(), status.goal.id.begin(), status.goal.id.end());
      while (bytes.size() % 4 != 0) bytes.push_back(0);
      put_stamp(bytes, status.goal.stamp);
      bytes.push_back(number_of(status.state));
    }
    return bytes;
  }

  std::set<std::string> listed(const Bytes& payload) const override {
    MessageReader reader(payload, kIdPlace);
    std::set<std::string> found;
    for (std::uint32_t left = reader.number(); left > 0; --left) {
      found.insert(reader.text(kIdBytes));
      // Padding before the stamp; then the state.
      reader.text((4 - reader.place() % 4) % 4);
      reader.stamp();
      reader.byte();
    }
    return found;
  }

  // Return whether a response to a goal accepts it.
  static bool is_accepted(const Bytes& payload) { return MessageReader(payload, kStatePlace).byte() != 0; }

  // Return the request for the result of a goal.
  static Bytes request(const GoalReference& goal) {
    Bytes bytes = encoding();
    bytes.insert(bytes.end(), goal.id.begin(), goal.id.end());
    return bytes;
  }

  // Return whether a result is that of an unknown goal.
  static bool is_unknown(const Bytes& payload) { return MessageReader(payload, kStatePlace).byte() == 0; }

  // Return the response to a goal, which is accepted or rejected.
  static Bytes accepted(bool is_accepted, const Stamp& stamp) {
    Bytes bytes = encoding();
    put_number(bytes, is_accepted ? 1 : 0);
    put_stamp(bytes, stamp);
    return bytes;
  }

  // Return the response to a cancellation: a return code of action_msgs/CancelGoal, and the goals.
  static Bytes canceling(std::uint8_t code, const std::vector<GoalReference>& goals) {
    Bytes bytes = encoding();
    put_number(bytes, code);
    put_number(bytes, static_cast<std::uint32_t>(goals.size()));
    for (const auto& goal : goals) put_info(bytes, goal);
    return bytes;
  }

  // Return the id of the goal whose result a client requests.
  static std::string id_of(const Bytes& payload) { return MessageReader(payload, kIdPlace).text(kIdBytes); }

  // Return an empty result, with the state of an unknown goal.
  static Bytes unknown(const Bytes& no_result) {
    Bytes bytes = no_result;
    bytes.at(kStatePlace) = 0;
    return bytes;
  }

 private:
  // Both follow the encoding.
  static constexpr std::size_t kIdPlace = 4, kStatePlace = 4, kIdBytes = 16;

  static Bytes encoding() { return {0, 1, 0, 0}; }

  static void put_info(Bytes& bytes, const GoalReference& goal) {
    bytes.insert(bytes.end(), goal.id.begin(), goal.id.end());
    put_stamp(bytes, goal.stamp);
  }

  static std::uint8_t number_of(GoalState state) {
    switch (state) {
      case GoalState::kWaiting: return 1;
      case GoalState::kExecuting: return 2;
      case GoalState::kCanceling: return 3;
      case GoalState::kSucceeded: return 4;
      case GoalState::kCanceled: return 5;
      case GoalState::kAborted: return 6;
      case GoalState::kRejected:
      case GoalState::kLost: return 0;
    }
    return 0;
  }
};

}  // namespace firm
