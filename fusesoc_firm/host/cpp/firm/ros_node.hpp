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
#include <map>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <firm/node.hpp>
#include <firm/topic.hpp>

namespace firm {

// What a node must know of a system: the bits of its streams, how many messages a queue holds unless the command line says
// so, and the topics of its converters, each kind in the order of the ids.
struct System {
  std::string name;
  unsigned width;
  std::size_t queue_depth;
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
  std::size_t depth;
  Overflow overflow = Overflow::kDropOldest;
  std::chrono::seconds drain{10};
  bool restarts = false;
  bool is_best_effort = false;
  std::string trace;
  bool wants_help = false;
};

// A whole number from 1 on. Throws UsageError.
inline std::size_t positive_number(const std::string& option, const std::string& text) {
  constexpr std::size_t kMostDigits = 9;
  if (text.empty() || text.size() > kMostDigits || text.find_first_not_of("0123456789") != std::string::npos ||
      std::stoul(text) == 0) {
    throw UsageError(option + " is '" + text + "'; legal: 1 to 999999999");
  }
  return std::stoul(text);
}

// One of several words: what it stands for. Throws UsageError.
template <typename Value>
Value word_of(const std::string& option, const std::string& text, const std::map<std::string, Value>& words) {
  if (const auto found = words.find(text); found != words.end()) return found->second;
  std::string legal;
  for (const auto& word : words) legal += (legal.empty() ? "" : ", ") + word.first;
  throw UsageError(option + " is '" + text + "'; legal: " + legal);
}

// The arguments that ROS has left; `has_quality` says whether topics of this ROS have a quality of service. Throws
// UsageError.
inline NodeArguments parse_arguments(const System& system, bool has_quality, int argc, char** argv) {
  NodeArguments arguments;
  arguments.depth = system.queue_depth;
  for (int index = 1; index < argc; ++index) {
    const std::string option = argv[index];
    const auto value = [&] {
      if (++index == argc) throw UsageError(option + " needs a value");
      return std::string(argv[index]);
    };
    if (option == "--help" || option == "-h") {
      arguments.wants_help = true;
      return arguments;
    }
    if (option == "--transport") {
      arguments.transport = value();
    } else if (option == "--depth") {
      arguments.depth = positive_number(option, value());
    } else if (option == "--overflow") {
      arguments.overflow = word_of<Overflow>(option, value(),
                                             {{"drop_oldest", Overflow::kDropOldest},
                                              {"drop_newest", Overflow::kDropNewest},
                                              {"block", Overflow::kBlock}});
    } else if (option == "--drain") {
      arguments.drain = std::chrono::seconds(positive_number(option, value()));
    } else if (option == "--restart") {
      arguments.restarts = true;
    } else if (option == "--trace") {
      arguments.trace = value();
    } else if (option == "--qos" && has_quality) {
      arguments.is_best_effort = word_of<bool>(option, value(), {{"best_effort", true}, {"reliable", false}});
    } else {
      throw UsageError("'" + option + "' is no option");
    }
  }
  if (arguments.transport.empty()) throw UsageError("--transport is missing");
  return arguments;
}

inline void print_help(std::ostream& out, const System& system, const std::string& ros_arguments, bool has_quality) {
  out << "The node of the system " << system.name << ": messages of its topics to the hardware, and back.\n\n"
      << "usage: " << system.name << "_node --transport ADDRESS [OPTION ...] [ROS' own arguments]\n\n"
      << "  --transport ADDRESS  the way to the hardware: pipe:COMMAND (a simulator), uart:DEVICE:BAUD[:rtscts],\n"
      << "                       dma:UIO:BUFFER[:poll]\n"
      << "  --depth N            messages that each queue holds, those of ROS too (" << system.queue_depth << ")\n"
      << "  --overflow WORD      what a full queue does with a message: drop_oldest (the default), drop_newest, or\n"
      << "                       block, which stops all topics\n"
      << "  --drain SECONDS      how long the node works on what it has when it is to end (10)\n"
      << "  --restart            open the transport again when it fails, as often as that happens\n"
      << "  --trace FILE         write each step of each message to FILE, as CSV\n";
  if (has_quality) out << "  --qos WORD           of all topics: reliable (the default) or best_effort\n";
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
  RunningNode(Node& node, std::chrono::seconds drain) : node_(node), drain_(drain), thread_([this] { run(); }) {}
  ~RunningNode() { stop(); }
  RunningNode(const RunningNode&) = delete;
  RunningNode& operator=(const RunningNode&) = delete;

  bool has_ended() const { return has_ended_; }

  // Let it finish what it has; the exit status.
  int stop() {
    node_.stop(drain_);
    if (thread_.joinable()) thread_.join();
    return status_;
  }

 private:
  void run() {
    status_ = node_.run();
    has_ended_ = true;
  }

  Node& node_;
  const std::chrono::seconds drain_;
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
  configuration.subscribers = static_cast<unsigned>(system.subscribers.size());
  configuration.publishers = static_cast<unsigned>(system.publishers.size());
  configuration.queue_depth = arguments.depth;
  configuration.overflow = arguments.overflow;
  configuration.restarts = arguments.restarts ? std::numeric_limits<unsigned>::max() : 0;
  configuration.log = &std::cerr;
  configuration.trace = arguments.trace.empty() ? nullptr : &trace;

  std::vector<MessageHandler> publish;
  for (const auto& topic : system.publishers) publish.push_back(ros.advertise(topic, arguments.depth));
  Node node(configuration, arguments.transport,
            [&](unsigned publisher, const std::uint8_t* payload, std::size_t size) { publish[publisher](payload, size); });
  for (const auto& topic : system.subscribers) {
    ros.subscribe(topic, arguments.depth, [&node, &topic](const std::uint8_t* payload, std::size_t size) {
      try {
        node.put(topic.id, payload, size);
      } catch (const std::length_error& fault) {
        std::cerr << topic.name << ": " << fault.what() << std::endl;
      }
    });
  }

  RunningNode running(node, arguments.drain);
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
    const NodeArguments arguments = parse_arguments(system, Ros::kHasQuality, argc, argv);
    if (arguments.wants_help) {
      print_help(std::cout, system, Ros::kArguments, Ros::kHasQuality);
      return 0;
    }
    if constexpr (Ros::kHasQuality) {
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
