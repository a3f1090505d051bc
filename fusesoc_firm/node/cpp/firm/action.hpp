// SPDX-License-Identifier: Apache-2.0
// The table of an action, and the counts of its goals. C++17, no dependencies.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <firm/action_messages.hpp>
#include <firm/services.hpp>
#include <firm/topic.hpp>

namespace firm {

// An action that the hardware serves, or to which it sends goals: the name of its block, the ids of the converters of its
// messages, its topics and services. In ROS 1, the topics to a server are goals and cancellations; those to its clients
// are states, feedback and, in ROS 1, results. The services of ROS 2 are those of goals, cancellations and results. If
// the side with a goal sends nothing about it for `limit`, the goal fails; a server accepts it after `accept_limit`.
// `no_result` is the payload of an empty result.
struct Action {
  std::string block;
  bool is_server;
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

  // The indices of the topics and services above.
  static constexpr std::size_t kGoal = 0, kCancel = 1;
  static constexpr std::size_t kStates = 0, kFeedback = 1, kResult = 2;
  static constexpr std::size_t kSendGoal = 0, kCancelGoal = 1, kGetResult = 2;
};

struct GoalStatistics {
  std::uint64_t goals = 0;
  std::uint64_t succeeded = 0;
  std::uint64_t canceled = 0;
  std::uint64_t aborted = 0;
  std::uint64_t rejected = 0;
  std::uint64_t unasked = 0;  // feedback and results of the hardware without a goal
  std::uint64_t lost = 0;     // goals of the hardware whose end is unknown

  // Count a goal that has ended.
  void count(GoalState state) {
    switch (state) {
      case GoalState::kSucceeded: ++succeeded; return;
      case GoalState::kCanceled: ++canceled; return;
      case GoalState::kAborted: ++aborted; return;
      case GoalState::kRejected: ++rejected; return;
      default: ++lost;
    }
  }
};

// Sends a payload to a subscriber of the hardware; returns whether it will be sent, and may throw.
using PutPayload = std::function<bool(unsigned subscriber, const std::uint8_t* payload, std::size_t size)>;
// Publishes a message on a topic of an action.
using PublishBytes = std::function<void(const Bytes&)>;

}  // namespace firm
