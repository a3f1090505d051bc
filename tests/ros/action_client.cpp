// A client of actionlib in C++ (roscpp), like action_peer.py:
//
//     action_client ACTION GOALS SEED
#include <actionlib/TestAction.h>
#include <actionlib/client/action_client.h>
#include <ros/ros.h>

#include <condition_variable>
#include <cstdint>
#include <iostream>
#include <mutex>
#include <random>
#include <string>

using Client = actionlib::ActionClient<actionlib::TestAction>;
using actionlib::CommState;

// A goal that runs: its feedback, and what the client knows of its state.
struct Goal {
  std::mutex mutex;
  std::condition_variable changed;
  std::string feedback;
  bool is_known = false;
  bool has_ended = false;

  void wait(bool is_held) {
    std::unique_lock<std::mutex> lock(mutex);
    changed.wait(lock, [&] { return has_ended || (is_held && is_known && !feedback.empty()); });
  }
};

int main(int argc, char** argv) {
  ros::init(argc, argv, "client", ros::init_options::AnonymousName);
  Client client(argv[1]);
  ros::AsyncSpinner spinner(1);
  spinner.start();
  client.waitForActionServerToStart();
  std::mt19937 source(static_cast<std::uint32_t>(std::stoul(argv[3])));
  std::cout << "ready" << std::endl;
  std::string line;
  std::getline(std::cin, line);
  std::cout << "[";
  for (int number = 0; number < std::stoi(argv[2]); ++number) {
    actionlib::TestGoal wanted;
    wanted.goal = static_cast<std::int32_t>(source() >> 2);
    const bool is_held = (wanted.goal & 0x70) == 0x70;
    Goal goal;
    Client::GoalHandle handle = client.sendGoal(
        wanted,
        [&](Client::GoalHandle changed) {
          const std::lock_guard<std::mutex> lock(goal.mutex);
          goal.is_known = changed.getCommState() != CommState::WAITING_FOR_GOAL_ACK;
          goal.has_ended = changed.getCommState() == CommState::DONE;
          goal.changed.notify_all();
        },
        [&](Client::GoalHandle, const actionlib::TestFeedbackConstPtr& message) {
          const std::lock_guard<std::mutex> lock(goal.mutex);
          goal.feedback += (goal.feedback.empty() ? "" : ", ") + std::to_string(message->feedback);
          goal.changed.notify_all();
        });
    goal.wait(is_held);
    if (is_held) handle.cancel();
    goal.wait(false);
    const auto result = handle.getResult();
    std::cout << (number ? ", [" : "[") << wanted.goal << ", \"" << handle.getTerminalState().toString() << "\", ["
              << goal.feedback << "], " << (result ? std::to_string(result->result) : "null") << "]";
    // No callback may use the goal after its end.
    handle.reset();
  }
  std::cout << "]" << std::endl;
  return 0;
}
