// SPDX-License-Identifier: Apache-2.0
// The main program of a system's node: command line, topics, signals, exit status. A generated node is a table and a
// call:
//
//     int main(int argc, char** argv) { return firm::run<firm::Ros1>(kSystem, argc, argv); }
//
// C++17; the middleware is a parameter: firm/ros1.hpp or firm/ros2.hpp.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <exception>
#include <fstream>
#include <iostream>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <firm/actions.hpp>
#include <firm/diagnostics.hpp>
#include <firm/log.hpp>
#include <firm/node.hpp>
#include <firm/open_transport.hpp>
#include <firm/parameters.hpp>
#include <firm/services.hpp>
#include <firm/status.hpp>
#include <firm/status_registers.hpp>
#include <firm/status_server.hpp>
#include <firm/status_watch.hpp>
#include <firm/topic.hpp>

namespace firm {

// The other end of a software port: a topic, or a converter of the hardware.
struct SoftwarePort {
  std::string topic;
  std::optional<unsigned> converter;
};

// The blocks in software; their ids count separately from those of the hardware.
struct Software {
  std::vector<SoftwarePort> inputs;
  std::vector<SoftwarePort> outputs;
};

// The system as its node sees it: the width of its streams in bits, the number of subscribers and publishers, the
// default queue depth in messages, the digest of its hardware, the topics, and the software.
struct System {
  std::string name;
  unsigned width;
  unsigned subscriber_count;
  unsigned publisher_count;
  std::size_t queue_depth;
  std::string digest;         // empty without a status
  bool has_status_registers;  // the status is a port for AXI4-Lite; otherwise frames read it
  std::vector<Topic> subscribers;
  std::vector<Topic> publishers;
  Topic diagnostics;
  std::vector<std::string> channels{};  // of the status, the subscribers first
  std::vector<Content> contents{};      // of the messages of subscribers, by id
  Software software{};
  std::vector<Service> services{};
  std::vector<Action> actions{};
  std::vector<Parameter> parameters{};

  bool has_status_frames() const { return !digest.empty() && !has_status_registers; }
  bool has_software() const { return !software.inputs.empty(); }
};

// An illegal command line.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct NodeArguments {
  std::string transport;
  std::string status;  // the address of the status' registers; empty: those named by the overlay
  std::string software;
  std::optional<std::size_t> depth;    // of all topics; nothing: each topic's own
  std::optional<bool> is_reliable;     // all topics; nothing: each topic's own
  Overflow overflow = Overflow::kDropOldest;
  std::chrono::seconds drain{10};
  bool restarts = false;
  bool is_managed = false;  // the node has lifecycle states
  std::string trace;
  std::map<std::string, std::string> parameters{};  // first values of those of the hardware, as texts
  bool wants_help = false;

  // Return the quality of service of a topic.
  Quality quality_of(const Topic& topic) const {
    Quality quality = topic.quality;
    quality.depth = depth.value_or(quality.depth);
    quality.is_reliable = is_reliable.value_or(quality.is_reliable);
    return quality;
  }
};

// Parse a positive whole number. Throws UsageError.
inline std::size_t positive_number(const std::string& option, const std::string& text) {
  constexpr std::size_t kMostDigits = 9;
  if (text.empty() || text.size() > kMostDigits || text.find_first_not_of("0123456789") != std::string::npos ||
      std::stoul(text) == 0) {
    throw UsageError(option + " is '" + text + "'; legal: 1 to 999999999");
  }
  return std::stoul(text);
}

// Return the value of one of several words. Throws UsageError.
template <typename Value>
Value word_of(const std::string& option, const std::string& text, const std::map<std::string, Value>& words) {
  if (const auto found = words.find(text); found != words.end()) return found->second;
  std::string legal;
  for (const auto& word : words) legal += (legal.empty() ? "" : ", ") + word.first;
  throw UsageError(option + " is '" + text + "'; legal: " + legal);
}

// The parameters of the node that have the effect of an option.
inline const std::vector<std::string>& parameter_names() {
  static const std::vector<std::string> names{"transport", "status", "software", "depth", "overflow",
                                              "drain",     "restart", "trace",   "lifecycle", "qos"};
  return names;
}

// Convert parameters to options. Throws UsageError.
inline std::vector<std::string> options_of(const std::map<std::string, std::string>& parameters) {
  std::vector<std::string> words;
  for (const auto& [name, text] : parameters) {
    const bool is_switch = name == "restart" || name == "lifecycle";
    if (is_switch && !word_of<bool>("the parameter " + name, text, {{"false", false}, {"true", true}})) continue;
    words.push_back("--" + name);
    if (!is_switch) words.push_back(text);
  }
  return words;
}

// Parse the arguments that ROS has left; only nodes of ROS 2 have a quality of service and lifecycle states. Throws
// UsageError.
inline NodeArguments parse_arguments(const System& system, bool is_ros2, const std::vector<std::string>& words) {
  NodeArguments arguments;
  for (std::size_t index = 0; index < words.size(); ++index) {
    const std::string option = words[index];
    const auto value = [&] {
      if (++index == words.size()) throw UsageError(option + " needs a value");
      return words[index];
    };
    if (option == "--help" || option == "-h") {
      arguments.wants_help = true;
      return arguments;
    }
    if (option == "--transport") {
      arguments.transport = value();
    } else if (option == "--status" && system.has_status_registers) {
      arguments.status = value();
    } else if (option == "--software" && system.has_software()) {
      arguments.software = value();
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
    } else if (option == "--lifecycle" && is_ros2) {
      arguments.is_managed = true;
    } else if (option == "--qos" && is_ros2) {
      arguments.is_reliable = word_of<bool>(option, value(), {{"best_effort", false}, {"reliable", true}});
    } else {
      throw UsageError("unknown option '" + option + "'");
    }
  }
  return arguments;
}

// Throws UsageError if an option is missing.
inline void check_complete(const System& system, const NodeArguments& arguments) {
  if (arguments.transport.empty()) throw UsageError("--transport is missing");
  if (arguments.software.empty() && system.has_software()) throw UsageError("--software is missing");
}

inline void print_help(std::ostream& out, const System& system, const std::string& ros_arguments, bool is_ros2) {
  out << "Carries messages between topics and the hardware of the system " << system.name << ".\n\n"
      << "usage: " << system.name << "_node --transport ADDRESS [OPTION ...] [ROS ARGUMENTS]\n\n"
      << "  --transport ADDRESS  the transport to the hardware: pipe:COMMAND (a simulator), uart:DEVICE:BAUD[:rtscts],\n"
      << "                       dma:UIO:BUFFER[:poll]\n";
  if (system.has_status_registers) {
    out << "  --status ADDRESS     the status registers, such as axi:/dev/uio1 (default on a board: the UIO device that\n"
        << "                       the overlay names)\n";
  }
  if (system.has_software()) {
    out << "  --software COMMAND   the command that runs the blocks in software, such as\n"
        << "                       'python3 -m fusesoc_firm.node.software_process SPECIFICATION'\n";
  }
  out << "  --depth N            capacity of each queue, including ROS queues, in messages (default: each topic's)\n"
      << "  --overflow WORD      action if a queue is full: drop_oldest (the default), drop_newest, or\n"
      << "                       block, which stops all topics\n"
      << "  --drain SECONDS      time limit for pending messages when the node ends (10)\n"
      << "  --restart            reopen the transport each time it fails\n"
      << "  --trace FILE         write each step of each message to FILE, as CSV\n";
  if (is_ros2) {
    out << "  --qos WORD           reliability of all topics: reliable or best_effort (default: each topic's)\n"
        << "  --lifecycle          start with lifecycle states, and carry messages only while active\n";
  }
  out << "  --help               print this help\n\n"
      << "Each option except --help is also a parameter of the node, such as transport; the command line has priority.\n"
      << ros_arguments << "\n\ntopics to the hardware:\n";
  for (const auto& topic : system.subscribers) out << "  " << topic.name << "  " << topic.type << "\n";
  out << "topics from the hardware:\n";
  for (const auto& topic : system.publishers) out << "  " << topic.name << "  " << topic.type << "\n";
  for (const auto& service : system.services) {
    out << (service.is_server ? "service of" : "service called by") << " the hardware:\n  " << service.name << "  "
        << service.type << "\n";
  }
  for (const auto& action : system.actions) {
    out << (action.is_server ? "action of the hardware:\n  " : "action to which the hardware sends goals:\n  ")
        << action.name << "\n";
  }
  out << "\nSIGINT and SIGTERM end the node after all pending messages; a second signal ends the node at once.\n"
      << "exit status: 0, 1 if the hardware or ROS failed, 2 for an invalid command line\n";
}

// Set by SIGINT or SIGTERM.
inline volatile std::sig_atomic_t is_interrupted = 0;

inline void handle_signals() {
  struct sigaction action {};
  action.sa_handler = [](int) { is_interrupted = 1; };
  // The second signal has its default effect.
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

// An engine that runs in its own thread during the lifetime of this object.
class RunningNode {
 public:
  RunningNode(Node& node, std::chrono::seconds drain) : node_(node), drain_(drain), thread_([this] { run(); }) {}
  ~RunningNode() { stop(); }
  RunningNode(const RunningNode&) = delete;
  RunningNode& operator=(const RunningNode&) = delete;

  bool has_ended() const { return has_ended_; }

  // Let the engine finish its queued messages; return the exit status.
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

// An engine for the hardware and, if the system has software, one for it, with the paths between them and the topics.
class Engines {
 public:
  // `publish` maps the names of the system's topics to their publishers. With ROS 1 (`is_first`), a failed call is
  // answered with the reason. Throws std::invalid_argument.
  Engines(const System& system, const NodeArguments& arguments, std::map<std::string, MessageHandler> publish,
          std::ostream* trace, bool is_first)
      : system_(system),
        parameters_(system.parameters, arguments.parameters),
        publish_(std::move(publish)),
        from_hardware_(system.publisher_count),
        calls_(system.services, is_first, putter(), fault_taker()),
        actions_(system.actions, is_first, putter(), fault_taker()) {
    NodeConfiguration configuration;
    configuration.width = system.width;
    configuration.subscribers = system.subscriber_count;
    configuration.publishers = system.publisher_count;
    configuration.contents = system.contents;
    configuration.queue_depth = arguments.depth.value_or(system.queue_depth);
    for (const auto& topic : system.subscribers) {
      if (topic.id) configuration.queue_depths[*topic.id] = arguments.quality_of(topic).depth;
    }
    for (const auto& action : system.actions) {
      // A result must not overtake feedback, and a cancellation must not overtake its goal.
      const auto [first, second] = action.is_server ? std::pair(action.goal, action.cancel)
                                                    : std::pair(action.feedback, action.result);
      configuration.shared_queues[second] = first;
      // Only feedback may be lost.
      configuration.queue_depths[second] = kUnlimitedDepth;
      if (action.is_server) configuration.queue_depths[first] = kUnlimitedDepth;
    }
    configuration.overflow = arguments.overflow;
    configuration.restarts = arguments.restarts ? std::numeric_limits<unsigned>::max() : 0;
    configuration.has_status = system.has_status_frames();
    configuration.log = [](Level level, const std::string& line) { node_log().say(level, line); };
    configuration.trace = trace;
    if (!system.services.empty() || !system.actions.empty()) watch_calls(configuration);
    // A simulator's registers cannot be accessed.
    if (system.has_status_registers && (!is_simulated(arguments.transport) || !arguments.status.empty())) {
      registers_.emplace(arguments.status);
    }
    hardware_ = std::make_unique<Node>(configuration, opener(arguments.transport), by_id(from_hardware_));
    for (const auto& topic : system.publishers) {
      if (topic.id) from_hardware_.at(*topic.id) = publish_.at(topic.name);
    }
    for (const auto& service : system.services) {
      const unsigned publisher = service.is_server ? service.response : service.request;
      from_hardware_.at(publisher) = [this, publisher](const std::uint8_t* payload, std::size_t size) {
        calls_.take(publisher, payload, size);
      };
    }
    for (const auto& action : system.actions) {
      const bool is_server = action.is_server;
      for (const unsigned publisher : {is_server ? action.feedback : action.goal, is_server ? action.result : action.cancel}) {
        from_hardware_.at(publisher) = [this, publisher](const std::uint8_t* payload, std::size_t size) {
          actions_.take(publisher, payload, size);
        };
      }
    }
    if (!system.has_software()) return;

    const auto& [inputs, outputs] = system.software;
    configuration.width = 8;
    configuration.subscribers = static_cast<unsigned>(inputs.size());
    configuration.publishers = static_cast<unsigned>(outputs.size());
    configuration.trace = nullptr;
    configuration.has_status = false;
    configuration.on_rejected = configuration.on_aborted = nullptr;
    configuration.on_restart = configuration.on_rest = nullptr;
    configuration.contents.clear();
    configuration.queue_depths.clear();
    configuration.shared_queues.clear();
    software_ = std::make_unique<Node>(configuration, "software:" + arguments.software, by_id(from_software_));
    for (unsigned id = 0; id < inputs.size(); ++id) {
      if (inputs[id].converter) from_hardware_.at(*inputs[id].converter) = into(*software_, id);
    }
    for (const auto& output : outputs) {
      from_software_.push_back(output.converter ? into(*hardware_, *output.converter) : publish_.at(output.topic));
    }
  }

  // Return the handler for the messages of a topic.
  MessageHandler taker(const Topic& topic) {
    std::vector<MessageHandler> takers;
    if (topic.id) takers.push_back(into(*hardware_, *topic.id));
    for (unsigned id = 0; id < system_.software.inputs.size(); ++id) {
      if (system_.software.inputs[id].topic == topic.name) takers.push_back(into(*software_, id));
    }
    return [takers, name = topic.name](const std::uint8_t* payload, std::size_t size) {
      try {
        for (const auto& take : takers) take(payload, size);
      } catch (const std::length_error& fault) {
        node_log().say(Level::kWarning, name + ": " + fault.what());
      }
    };
  }

  // Serve and call all services, and exchange the goals of all actions, with a middleware.
  template <typename Ros>
  void connect(Ros& ros) {
    calls_.connect(ros);
    actions_.connect(ros);
  }

  // Stop taking calls and goals, and wait until all are answered, or for `longest`; then let the others fail.
  void drain(std::chrono::nanoseconds longest) {
    calls_.drain(longest);
    actions_.drain(longest);
  }

  NodeActions& actions() { return actions_; }
  // Return whether a thread of the services or actions has failed, after which the node has to end.
  bool has_fault() const { return has_fault_; }
  Node& hardware() { return *hardware_; }
  Node* software() { return software_.get(); }

  // Call these functions with the block and the counts of each service, and of each action.
  template <typename TakeCalls, typename TakeGoals>
  void for_each_count(TakeCalls take_calls, TakeGoals take_goals) const {
    const auto calls = calls_.statistics();
    for (std::size_t index = 0; index < calls.size(); ++index) take_calls(system_.services[index].block, calls[index]);
    const auto goals = actions_.statistics();
    for (std::size_t index = 0; index < goals.size(); ++index) take_goals(system_.actions[index].block, goals[index]);
  }

  HardwareParameters& parameters() { return parameters_; }

  // Set parameters of the hardware; return the reason why they are refused, or an empty text.
  std::string set(const HardwareParameters::Values& values) {
    if (!has_status()) return parameters_.set(values, &no_access);
    return parameters_.set(values, [this](const Bytes& request) {
      return status_word(access_status(request, std::chrono::seconds(5)));
    });
  }

  bool has_status() const { return system_.has_status_frames() || registers_.has_value(); }

  // Return the answer of the status to a request. Throws TransportError.
  Bytes access_status(const Bytes& request, std::chrono::nanoseconds patience) {
    return registers_ ? registers_->access(request) : hardware_->access_status(request, patience);
  }

  // Wait while work remains. Messages may alternate between hardware and software, and neither knows whether more will
  // follow.
  void settle(std::chrono::nanoseconds longest) const {
    const auto end = std::chrono::steady_clock::now() + longest;
    for (std::uint64_t before = 0, now = moved(); now != before && std::chrono::steady_clock::now() < end; now = moved()) {
      before = now;
      std::this_thread::sleep_for(kSilence);
    }
  }

 private:
  static constexpr std::chrono::seconds kSilence{1};

  // Report events of the hardware to the services and actions.
  void watch_calls(NodeConfiguration& configuration) {
    configuration.on_rejected = [this](unsigned subscriber) {
      calls_.refuse_request(subscriber);
      actions_.refuse_goal(subscriber);
    };
    configuration.on_aborted = [this](unsigned publisher) {
      calls_.refuse_response(publisher);
      actions_.refuse_result(publisher);
    };
    configuration.on_restart = [this] {
      calls_.forget();
      actions_.forget();
    };
    configuration.on_rest = [this] {
      calls_.rest();
      actions_.rest();
    };
  }

  NodeCalls::Put putter() {
    return [this](unsigned id, const std::uint8_t* payload, std::size_t size) {
      return hardware_->put(id, payload, size);
    };
  }

  // Return a function that records and reports an error of a thread.
  FaultHandler fault_taker() {
    return [this](const std::string& reason) {
      node_log().say(Level::kError, reason);
      has_fault_ = true;
    };
  }

  // Return a function that opens the hardware, and refuses that of another system.
  Node::Open opener(const std::string& address) {
    return [this, address](const TransportOptions& options) {
      // Opening the transport would reset the hardware of another system.
      if (registers_) check_digest(*registers_, system_.digest, system_.name);
      if (!has_status()) parameters_.restore(&no_access);
      auto transport = open_transport(address, options);
      if (registers_) {
        parameters_.restore([this](const Bytes& request) { return status_word(registers_->access(request)); });
      }
      if (system_.has_status_frames()) {
        StatusAccess access(*transport);
        check_digest(access, system_.digest, system_.name);
        parameters_.restore([&](const Bytes& request) { return access.pass(request); });
      }
      return transport;
    };
  }

  static std::uint32_t no_access(const Bytes&) {
    throw TransportError("the node has no access to the registers of the parameters, which are at their defaults");
  }

  static Node::Publish by_id(const std::vector<MessageHandler>& handlers) {
    return [&handlers](unsigned id, const std::uint8_t* payload, std::size_t size) { handlers.at(id)(payload, size); };
  }

  static MessageHandler into(Node& node, unsigned id) {
    return [&node, id](const std::uint8_t* payload, std::size_t size) { node.put(id, payload, size); };
  }

  std::uint64_t moved() const {
    const auto hardware = hardware_->statistics(), software = software_->statistics();
    return hardware.sent + hardware.published + software.sent + software.published;
  }

  const System& system_;
  HardwareParameters parameters_;
  std::optional<StatusRegisters> registers_;  // if frames do not read the status
  const std::map<std::string, MessageHandler> publish_;
  std::vector<MessageHandler> from_hardware_;
  std::vector<MessageHandler> from_software_;
  std::unique_ptr<Node> hardware_;
  std::unique_ptr<Node> software_;
  std::atomic<bool> has_fault_{false};
  NodeCalls calls_;  // after the nodes, as its threads use them
  NodeActions actions_;
};

// Return the word of a register of the hardware. Throws TransportError.
inline std::uint32_t word_at(Engines& engines, std::uint32_t address) {
  return status_word(engines.access_status(status_request(address, 0), std::chrono::seconds(1)));
}

// Return the line of an engine's counts; `lost` messages were published, but ROS did not deliver them.
inline std::string statistics_line(const std::string& name, const Node& node, std::uint64_t lost = 0) {
  const NodeStatistics counted = node.statistics();
  std::ostringstream line;
  line << name << ": " << counted.received << " received, " << counted.dropped << " dropped, " << counted.sent
       << " sent, " << counted.published << " published, " << counted.errors << " errors, " << counted.restarts
       << " restarts, " << lost << " lost by ROS";
  return line.str();
}

inline std::string calls_line(const std::string& block, const CallStatistics& counted) {
  std::ostringstream line;
  line << block << ": " << counted.called << " called, " << counted.answered << " answered, " << counted.failed
       << " failed, " << counted.unasked << " unasked";
  return line.str();
}

inline std::string goals_line(const std::string& block, const GoalStatistics& counted) {
  std::ostringstream line;
  line << block << ": " << counted.goals << " goals, " << counted.succeeded << " succeeded, " << counted.canceled
       << " canceled, " << counted.aborted << " aborted, " << counted.rejected << " rejected, " << counted.unasked
       << " unasked, " << counted.lost << " lost";
  return line.str();
}

// The services and actions while they are connected to a middleware, which outlives them.
template <typename Ros>
class ConnectedCalls {
 public:
  ConnectedCalls(Ros& ros, Engines& engines) : ros_(ros) {
    try {
      engines.connect(ros);
    } catch (...) {
      ros_.stop_calls();
      throw;
    }
  }
  ~ConnectedCalls() { ros_.stop_calls(); }
  ConnectedCalls(const ConnectedCalls&) = delete;
  ConnectedCalls& operator=(const ConnectedCalls&) = delete;

 private:
  Ros& ros_;
};

// Run the started node until a signal, ROS, or the hardware ends it. Return the exit status.
template <typename Ros>
int serve(Ros& ros, const System& system, const NodeArguments& arguments) {
  std::ofstream trace;
  if (!arguments.trace.empty()) {
    trace.open(arguments.trace);
    if (!trace) throw UsageError("cannot write '" + arguments.trace + "'");
  }
  // It is published in every state.
  Diagnosis diagnosis(ros, system.diagnostics);
  if constexpr (Ros::kVersion == 2) {
    if (arguments.is_managed) ros.manage();
  }
  std::map<std::string, MessageHandler> publish;
  for (const auto& topic : system.publishers) {
    publish[topic.name] = ros.advertise(topic, arguments.quality_of(topic));
  }
  Engines engines(system, arguments, std::move(publish), arguments.trace.empty() ? nullptr : &trace,
                  Ros::kVersion == 1);
  for (const auto& topic : system.subscribers) {
    Quality quality = arguments.quality_of(topic);
    // Only the node's queue then drops messages, which it counts. If it blocks, the one of ROS must have a limit.
    if (!Ros::kCountsDrops && arguments.overflow != Overflow::kBlock) quality.depth = Ros::kUnlimited;
    ros.subscribe(topic, quality, engines.taker(topic));
  }

  RunningNode hardware(engines.hardware(), arguments.drain);
  if (!system.parameters.empty()) {
    ros.offer(engines.parameters(), [&](const HardwareParameters::Values& values) { return engines.set(values); });
  }
  const ConnectedCalls<Ros> calls(ros, engines);
  std::optional<RunningNode> software;
  if (engines.software()) software.emplace(*engines.software(), arguments.drain);
  std::optional<StatusWatch> watch;
  std::optional<StatusServer> server;
  if (engines.has_status()) {
    const auto access = [&](const Bytes& request) { return engines.access_status(request, std::chrono::seconds(5)); };
    server.emplace(served_names(system.name, arguments.transport), access,
                   [](const std::string& line) { node_log().say(Level::kWarning, line); }, system.parameters);
    watch.emplace([&](std::uint32_t address) { return word_at(engines, address); }, system.channels);
  }
  const auto is_running = [&] { return !hardware.has_ended() && !(software && software->has_ended()); };
  while (!is_interrupted && is_running() && !engines.has_fault() && ros.spin(std::chrono::milliseconds(50))) {
    engines.actions().tick();
    diagnosis.tell([&] {
      std::vector<Report> reports{report_of(system.name + ": node", engines.hardware(), ros.lost())};
      const auto add = [&](const std::string& block, const auto& counted) { add_counts(reports[0], block, counted); };
      engines.for_each_count(add, add);
      if (watch) reports.push_back(watch->report(system.name + ": hardware"));
      if (engines.software()) reports.push_back(report_of(system.name + ": software", *engines.software()));
      return reports;
    });
  }
  // Handle messages that ROS has already received.
  ros.spin(std::chrono::milliseconds(0));
  ros.unsubscribe();
  ros.spin_during([&] { engines.drain(arguments.drain); });
  if (software && is_running()) engines.settle(arguments.drain);
  int status = software ? software->stop() : 0;
  status = std::max({status, hardware.stop(), engines.has_fault() ? 1 : 0});
  std::vector<std::string> lines{statistics_line(system.name + "_node", engines.hardware(), ros.lost())};
  if (software) lines.push_back(statistics_line("its software", *engines.software()));
  engines.for_each_count([&](const auto&... counts) { lines.push_back(calls_line(counts...)); },
                         [&](const auto&... counts) { lines.push_back(goals_line(counts...)); });
  // ROS's log has to get them before its end, and the terminal after all messages.
  for (const auto& line : lines) node_log().pass(Level::kInfo, line);
  ros.flush();
  for (const auto& line : lines) node_log().print(line);
  return status;
}

// Run the node with a command line without the arguments of ROS. Return the exit status.
template <typename Ros>
int run(Ros& ros, const System& system, const std::vector<std::string>& given) {
  constexpr bool is_ros2 = Ros::kVersion == 2;
  if (parse_arguments(system, is_ros2, given).wants_help) {
    print_help(std::cout, system, Ros::kArguments, is_ros2);
    return 0;
  }
  if (!ros.start([] { return is_interrupted != 0; })) return 0;
  std::vector<std::string> words = options_of(ros.parameters(parameter_names()));
  words.insert(words.end(), given.begin(), given.end());
  NodeArguments arguments = parse_arguments(system, is_ros2, words);
  check_complete(system, arguments);
  std::vector<std::string> names;
  for (const auto& parameter : system.parameters) names.push_back(parameter.name);
  arguments.parameters = ros.parameters(names);
  return serve(ros, system, arguments);
}

// Report the exception that is being handled. Return the exit status.
inline int report_fault(const System& system) {
  const auto say = [&](const std::string& reason) { node_log().say(Level::kError, system.name + "_node: " + reason); };
  try {
    throw;
  } catch (const UsageError& fault) {
    say(std::string(fault.what()) + "; see --help");
    return 2;
  } catch (const std::exception& fault) {
    say(fault.what());
    return 1;
  }
}

template <typename Ros>
int run(const System& system, int argc, char** argv) {
  try {
    handle_signals();
    Ros ros(argc, argv, system.name + "_node");
    try {
      return run(ros, system, std::vector<std::string>(argv + 1, argv + argc));
    } catch (const std::exception&) {
      const int status = report_fault(system);
      // ROS's log gets the fault.
      ros.flush();
      return status;
    }
  } catch (const std::exception&) {
    return report_fault(system);
  }
}

}  // namespace firm
