// A SimpleActionServer of roscpp, like action_server_peer.py:
//
//     action_server ACTION
#include <actionlib/TestAction.h>
#include <actionlib/server/simple_action_server.h>
#include <ros/ros.h>

#include <cstdint>
#include <functional>
#include <iostream>
#include <string>

using Server = actionlib::SimpleActionServer<actionlib::TestAction>;

int main(int argc, char** argv) {
  ros::init(argc, argv, "server", ros::init_options::AnonymousName);
  ros::NodeHandle node;
  std::function<void(const actionlib::TestGoalConstPtr&)> run;
  Server server(node, argv[1], [&run](const actionlib::TestGoalConstPtr& goal) { run(goal); }, false);
  run = [&server](const actionlib::TestGoalConstPtr& goal) {
    constexpr std::int32_t kHeld = 0x70, kAborted = 2;
    const bool is_aborted = goal->goal >> 20 == kAborted, is_held = (goal->goal & kHeld) == kHeld;
    const std::int32_t count = is_aborted || is_held ? 1 : goal->goal % 4;
    for (std::int32_t step = 1; step <= count; ++step) {
      actionlib::TestFeedback feedback;
      feedback.feedback = goal->goal + step;
      server.publishFeedback(feedback);
    }
    while (is_held && !server.isPreemptRequested() && ros::ok()) ros::WallDuration(0.01).sleep();
    actionlib::TestResult result;
    result.result = is_aborted ? 7 : goal->goal;
    if (is_aborted) {
      server.setAborted(result);
    } else if (is_held) {
      server.setPreempted(result);
    } else {
      server.setSucceeded(result);
    }
    std::cout << "[" << goal->goal << ", \"" << (is_aborted ? "ABORTED" : is_held ? "CANCELED" : "SUCCEEDED") << "\"]"
              << std::endl;
  };
  server.start();
  std::cout << "ready" << std::endl;
  ros::spin();
  return 0;
}
