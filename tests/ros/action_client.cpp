// A client of actionlib in C++ (roscpp), like action_peer.py:
//
//     action_client ACTION GOALS SEED
#include <actionlib/TestAction.h>
#include <actionlib/client/simple_action_client.h>
#include <ros/ros.h>

#include <cstdint>
#include <iostream>
#include <random>
#include <string>

int main(int argc, char** argv) {
  ros::init(argc, argv, "client", ros::init_options::AnonymousName);
  using Client = actionlib::SimpleActionClient<actionlib::TestAction>;
  Client client(argv[1], true);
  client.waitForServer();
  std::mt19937 source(static_cast<std::uint32_t>(std::stoul(argv[3])));
  std::cout << "ready" << std::endl;
  std::string line;
  std::getline(std::cin, line);
  std::cout << "[";
  for (int number = 0; number < std::stoi(argv[2]); ++number) {
    actionlib::TestGoal goal;
    goal.goal = static_cast<std::int32_t>(source() >> 2);
    const bool is_held = (goal.goal & 0x70) == 0x70;
    std::string feedback;
    client.sendGoal(goal, Client::SimpleDoneCallback(), Client::SimpleActiveCallback(),
                    [&](const actionlib::TestFeedbackConstPtr& message) {
                      feedback += (feedback.empty() ? "" : ", ") + std::to_string(message->feedback);
                      if (is_held) client.cancelGoal();
                    });
    client.waitForResult();
    std::cout << (number ? ", [" : "[") << goal.goal << ", \"" << client.getState().toString() << "\", [" << feedback
              << "], " << client.getResult()->result << "]";
  }
  std::cout << "]" << std::endl;
  return 0;
}
