// SPDX-License-Identifier: Apache-2.0
// The main program of a system's node: command line, topics, signals, exit status. A generated node is a table and a call:
//
//     int main(int argc, char** argv) { return firm::run<firm::Ros1>(kSystem, argc, argv); }
//
// C++17; the middleware is a parameter, firm/ros1.hpp or firm/ros2.hpp.
#pragma once

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <exception>
#include <fstream>
#include <iostream>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <firm/node.hpp>
#include <firm/topic.hpp>

namespace firm {

// What a node must know of a system: the bits of its streams, how many messages each queue holds unless the command line
// says so, how many converters there are of either kind, and the topics of those that have one.
struct System {
  std::string name;
  unsigned width;
  std::size_t queue_depth;
  unsigned subscriber_count;
  unsigned publisher_count;
  std::vector<Topic> subscribers;
  std::vector<Topic> publishers;
};

// A command line that is none.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct NodeArguments {
  std::string transport;
  std::size_t queue;
  bool restarts = false;
  bool is_best_effort = false;
  std::string trace;
  bool wants_help = false;
};

// The arguments that ROS has left. Throws UsageError.
inline NodeArguments parse_arguments(const System& system, bool has_best_effort, int argc, char** argv) {
  NodeArguments arguments;
  arguments.queue = system.queue_depth;
  for (int index = 1; index < argc; ++index) {
    const std::string option = argv[index];
    const auto value = [&] {
      if (++index == argc) throw UsageError(option + " needs a value");
      return std::string(argv[index]);
    };
    if (option == "--help" || option == "-h") {
      arguments.wants_help = true;
      return arguments;
    } else if (option == "--transport") {
      arguments.transport = value();
    } else if (option == "--queue") {
      const std::string text = value();
      if (text.empty() || text.size() > 9 || text.find_first_not_of("0123456789") != std::string::npos ||
          (arguments.queue = std::stoul(text)) == 0) {
        throw UsageError("--queue is '" + text + "'; legal: 1 to 999999999");
      }
    } else if (option == "--restart") {
      arguments.restarts = true;
    } else if (option == "--trace") {
      arguments.trace = value();
    } else if (option == "--best-effort" && has_best_effort) {
      arguments.is_best_effort = true;
    } else {
      throw UsageError("'" + option + "' is no option");
    }
  }
  if (arguments.transport.empty()) throw UsageError("--transport is missing");
  return arguments;
}

inline void print_help(std::ostream& out, const System& system, const std::string& ros_arguments, bool has_best_effort) {
  out << "The node of the system " << system.name << ": messages of its topics to the hardware, and back.\n\n"
      << "usage: " << system.name << "_node --transport ADDRESS [OPTION ...] [ROS' own arguments]\n\n"
      << "  --transport ADDRESS  the way to the hardware: pipe:COMMAND (a simulator), uart:..., dma:...\n"
      << "  --queue N            messages that wait for the hardware at most, for each subscriber ("
      << system.queue_depth << ")\n"
      << "  --restart            open the transport again when it fails, as often as that happens\n"
      << "  --trace FILE         write each step of each message to FILE, as CSV\n";
  if (has_best_effort) out << "  --best-effort        match peers that do not promise to deliver, such as sensors\n";
  out << "  --help               print this\n\n" << ros_arguments << "\n\ntopics to the hardware:\n";
  for (const auto& topic : system.subscribers) out << "  " << topic.name << "  " << topic.type << "\n";
  out << "topics from the hardware:\n";
  for (const auto& topic : system.publishers) out << "  " << topic.name << "  " << topic.type << "\n";
  out << "\nSIGINT and SIGTERM end it when all that was taken is through; a second one ends it at once.\n"
      << "exit status: 0, 1 if the hardware or ROS failed, 2 for a wrong command line\n";
}

// Whether SIGINT or SIGTERM has come.
inline volatile std::sig_atomic_t is_interrupted = 0;

inline void handle_signals() {
  struct sigaction action {};
  action.sa_handler = [](int) { is_interrupted = 1; };
  // The second one does what it does to every program.
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

// An engine that runs in a thread of its own for as long as this lives.
class RunningNode {
 public:
  explicit RunningNode(Node& node) : node_(node), thread_([this] { run(); }) {}
  ~RunningNode() { stop(); }
  RunningNode(const RunningNode&) = delete;
  RunningNode& operator=(const RunningNode&) = delete;

  bool has_ended() const { return has_ended_; }

  // Let it finish what it has; the exit status.
  int stop() {
    node_.stop(kDrain);
    if (thread_.joinable()) thread_.join();
    return status_;
  }

 private:
  static constexpr std::chrono::seconds kDrain{10};

  void run() {
    status_ = node_.run();
    has_ended_ = true;
  }

  Node& node_;
  int status_ = 0;
  std::atomic<bool> has_ended_{false};
  std::thread thread_;
};

// Be the node until a signal, ROS, or the hardware ends it. The exit status.
template <typename Ros>
int serve(Ros& ros, const System& system, const NodeArguments& arguments) {
  std::ofstream trace;
  if (!arguments.trace.empty()) {
    trace.open(arguments.trace);
    if (!trace) throw UsageError("cannot write '" + arguments.trace + "'");
  }
  if (!ros.start([] { return is_interrupted != 0; })) return 0;

  NodeConfiguration configuration;
  configuration.width = system.width;
  configuration.subscribers = system.subscriber_count;
  configuration.publishers = system.publisher_count;
  configuration.queue_depth = arguments.queue;
  configuration.restarts = arguments.restarts ? std::numeric_limits<unsigned>::max() : 0;
  configuration.log = &std::cerr;
  configuration.trace = arguments.trace.empty() ? nullptr : &trace;

  std::vector<MessageHandler> publish(system.publisher_count);
  for (const auto& topic : system.publishers) publish.at(topic.id) = ros.advertise(topic, arguments.queue);
  Node node(configuration, arguments.transport,
            [&](unsigned publisher, const std::uint8_t* payload, std::size_t size) { publish[publisher](payload, size); });
  for (const auto& topic : system.subscribers) {
    ros.subscribe(topic, arguments.queue, [&node, &topic](const std::uint8_t* payload, std::size_t size) {
      try {
        node.put(topic.id, payload, size);
      } catch (const std::length_error& fault) {
        std::cerr << topic.name << ": " << fault.what() << std::endl;
      }
    });
  }

  RunningNode running(node);
  while (!is_interrupted && !running.has_ended() && ros.spin(std::chrono::milliseconds(50))) {
  }
  // What ROS has for us already.
  ros.spin(std::chrono::milliseconds(0));
  ros.unsubscribe();
  const int status = running.stop();
  ros.flush();
  const NodeStatistics counted = node.statistics();
  std::cerr << system.name << "_node: " << counted.received << " received, " << counted.dropped << " dropped, "
            << counted.sent << " sent, " << counted.published << " published, " << counted.errors << " errors, "
            << counted.restarts << " restarts" << std::endl;
  return status;
}

template <typename Ros>
int run(const System& system, int argc, char** argv) {
  try {
    handle_signals();
    Ros ros(argc, argv, system.name + "_node");
    const NodeArguments arguments = parse_arguments(system, Ros::kHasBestEffort, argc, argv);
    if (arguments.wants_help) {
      print_help(std::cout, system, Ros::kArguments, Ros::kHasBestEffort);
      return 0;
    }
    if constexpr (Ros::kHasBestEffort) {
      if (arguments.is_best_effort) ros.be_best_effort();
    }
    return serve(ros, system, arguments);
  } catch (const UsageError& fault) {
    std::cerr << system.name << "_node: " << fault.what() << "; --help says more" << std::endl;
    return 2;
  } catch (const std::exception& fault) {
    std::cerr << system.name << "_node: " << fault.what() << std::endl;
    return 1;
  }
}

}  // namespace firm
