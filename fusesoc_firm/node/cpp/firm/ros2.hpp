// SPDX-License-Identifier: Apache-2.0
// ROS 2 as a carrier of bytes: rcl with serialised messages. The node looks up the type support of messages at run
// time, so it needs no message packages to compile, and messages are never parsed.
//
//     firm::Ros2 ros(argc, argv, "quat2euler");                     // removes ROS's own arguments from argv
//     ros.subscribe(topic, topic.quality, [](const std::uint8_t* data, std::size_t size) { ... });
//     firm::MessageHandler publish = ros.advertise(topic, topic.quality);  // any thread may call it
//     while (running) ros.spin(std::chrono::milliseconds(50));
//     ros.flush();
//
// C++17; rcl is part of every ROS 2.
#pragma once

#include <rcl/arguments.h>
#include <rcl/error_handling.h>
#include <rcl/graph.h>
#include <rcl/init.h>
#include <rcl/init_options.h>
#include <rcl/logging.h>
#include <rcl/logging_rosout.h>
#include <rcl/node.h>
#include <rcl/publisher.h>
#include <rcl/subscription.h>
#include <rcl/wait.h>
#include <rcl_yaml_param_parser/parser.h>
#include <rcutils/logging_macros.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <firm/log.hpp>
#include <firm/rcl.hpp>
#include <firm/ros2_lifecycle.hpp>
#include <firm/ros2_parameters.hpp>
#include <firm/ros2_services.hpp>
#include <firm/topic.hpp>

namespace firm {

// A node of ROS 2.
class Ros2 {
 public:
  static constexpr unsigned kVersion = 2;
  // All messages have numbers.
  static constexpr bool kCountsDrops = true;
  static constexpr std::size_t kUnlimited = 0;
  static constexpr const char* kArguments =
      "ROS arguments, after --ros-args: -r NAME:=VALUE remaps a topic, -r __node:=, -r __ns:=, --log-level";

  // Remove ROS's own arguments from `argv`. The node is called `name` unless `__node:=` is given. Throws
  // MiddlewareError.
  Ros2(int& argc, char** argv, std::string name) : name_(std::move(name)) {
    rcl_init_options_t options = rcl_get_zero_initialized_init_options();
    check_rcl(rcl_init_options_init(&options, rcl_get_default_allocator()), "start ROS 2");
    const rcl_ret_t result = rcl_init(argc, argv, &options, &context_);
    ignore(rcl_init_options_fini(&options));
    check_rcl(result, "start ROS 2");
    remove_ros_arguments(argc, argv);
  }

  ~Ros2() {
    node_log().connect({});
    unsubscribe();
    lifecycle_.reset();
    servers_.clear();
    parameter_servers_.clear();
    clients_.clear();
    for (auto& publisher : publishers_) ignore(rcl_publisher_fini(&publisher->rcl, &node_));
    if (is_started_) {
      ignore(rcl_wait_set_fini(&waiting_));
      ignore(rcl_node_fini(&node_));
      ignore(rcl_logging_fini());
    }
    ignore(rcl_shutdown(&context_));
    ignore(rcl_context_fini(&context_));
  }

  Ros2(const Ros2&) = delete;
  Ros2& operator=(const Ros2&) = delete;

  // Become a node. Throws MiddlewareError.
  bool start(const std::function<bool()>&) {
    const rcl_allocator_t allocator = rcl_get_default_allocator();
    check_rcl(rcl_logging_configure(&context_.global_arguments, &allocator), "log");
    rcl_node_options_t options = rcl_node_get_default_options();
    // The log of rcl does not wait until its readers have received a line.
    options.enable_rosout = false;
    check_rcl(rcl_node_init(&node_, name_.c_str(), "", &context_, &options), "create the node " + name_);
    check_rcl(rcl_wait_set_init(&waiting_, 0, 0, 0, 0, 0, 0, &context_, allocator), "wait for messages");
    is_started_ = true;
    if (rcl_logging_rosout_enabled()) open_log();
    return true;
  }

  // Return the parameters of the node with these names that command line and parameter files set, as texts. Throws
  // MiddlewareError.
  std::map<std::string, std::string> parameters(const std::vector<std::string>& names) const {
    rcl_params_t* given = nullptr;
    check_rcl(rcl_arguments_get_param_overrides(&context_.global_arguments, &given), "read the parameters");
    std::map<std::string, std::string> found;
    for (std::size_t node = 0; given != nullptr && node < given->num_nodes; ++node) {
      if (!is_meant(given->node_names[node])) continue;
      const rcl_node_params_t& set = given->params[node];
      for (std::size_t index = 0; index < set.num_params; ++index) {
        const std::string name = set.parameter_names[index];
        if (std::find(names.begin(), names.end(), name) == names.end()) continue;
        if (const auto text = text_of(set.parameter_values[index])) found[name] = *text;
      }
    }
    if (given != nullptr) rcl_yaml_node_struct_fini(given);
    return found;
  }

  // Become a node with lifecycle states: topics and services that are created after this call are used only while the
  // node is active. Throws MiddlewareError.
  void manage() {
    is_active_ = false;
    lifecycle_ = std::make_unique<Lifecycle>(node_, [this](bool is_active) { change(is_active); });
  }

  // Pass every message of a topic to `handler`, in the thread that calls spin(). Throws MiddlewareError.
  void subscribe(const Topic& topic, const Quality& quality, MessageHandler handler) {
    auto made = std::make_unique<Subscription>(quality, topic.type, std::move(handler));
    rcl_subscription_options_t options = rcl_subscription_get_default_options();
    options.qos = profile(quality);
    check_rcl(rcl_subscription_init(&made->rcl, &node_, type_support(topic), topic.name.c_str(), &options),
              "subscribe to " + topic.name);
    subscriptions_.push_back(std::move(made));
  }

  // Pass every call of a service to `handler`, in the thread that calls spin(). Throws MiddlewareError.
  void serve(const Service& service, CallHandler handler) {
    servers_.push_back(std::make_unique<RawServer>(node_, service, std::move(handler)));
    if (is_active_) servers_.back()->open();
  }

  // Let clients read and set the parameters of the hardware, and publish their changes, in every state of the node; both
  // arguments outlive the services.
  // Throws MiddlewareError.
  void offer(HardwareParameters& parameters, SetParameters set) {
    parameters_ = std::make_unique<ParameterServices>(parameters, std::move(set));
    const auto serve_always = [this](const Service& service, CallHandler handler) {
      parameter_servers_.push_back(std::make_unique<RawServer>(node_, service, std::move(handler)));
      parameter_servers_.back()->open();
    };
    parameters_->open(rcl_node_get_fully_qualified_name(&node_), serve_always,
                      advertise(own_topic("/parameter_events", "ParameterEvent"), rmw_qos_profile_parameter_events));
  }

  // Return a function that calls a service. Throws MiddlewareError.
  CallHandler caller(const Service& service) {
    clients_.push_back(std::make_unique<RawClient>(node_, service));
    return [this, client = clients_.back().get()](Bytes payload, AnswerHandler answer) {
      if (!is_active_) return answer({std::nullopt, "the node is not active"});
      client->call(payload, std::move(answer));
    };
  }

  // Take responses, but no more calls, during `drain`, which waits until all calls are answered.
  void spin_during(const std::function<void()>& drain) {
    if (servers_.empty() && clients_.empty()) return;
    std::atomic<bool> is_done{false};
    std::thread draining([&] {
      drain();
      is_done = true;
    });
    is_serving_ = false;
    while (!is_done) spin(std::chrono::milliseconds(10));
    draining.join();
  }

  // Stop serving and answering calls, since the handlers may end.
  void stop_calls() {
    is_serving_ = false;
    for (const auto& client : clients_) client->stop();
  }

  // Return a function that publishes messages of a topic. Both this call and the function throw MiddlewareError.
  MessageHandler advertise(const Topic& topic, const Quality& quality) {
    MessageHandler publish = advertise(topic, profile(quality));
    if (!lifecycle_) return publish;
    return [this, publish = std::move(publish)](const std::uint8_t* data, std::size_t size) {
      if (is_active_) publish(data, size);
    };
  }

  // Handle incoming messages for about `duration`. Returns false if ROS asks the node to end. Throws MiddlewareError.
  bool spin(std::chrono::milliseconds duration) {
    look_at_peers();
    const auto servers = waiting_servers();
    const auto subscriptions = waiting_subscriptions();
    if (subscriptions.empty() && servers.empty() && clients_.empty()) {
      // rcl does not wait on an empty set.
      std::this_thread::sleep_for(duration);
      return rcl_context_is_valid(&context_);
    }
    check_rcl(rcl_wait_set_resize(&waiting_, subscriptions.size(), 0, 0, clients_.size(), servers.size(), 0),
              "wait for messages");
    check_rcl(rcl_wait_set_clear(&waiting_), "wait for messages");
    for (const auto& server : servers) {
      check_rcl(rcl_wait_set_add_service(&waiting_, server.rcl, nullptr), "wait for calls");
    }
    for (const auto& client : clients_) {
      check_rcl(rcl_wait_set_add_client(&waiting_, client->rcl(), nullptr), "wait for responses");
    }
    for (const auto* subscription : subscriptions) {
      check_rcl(rcl_wait_set_add_subscription(&waiting_, &subscription->rcl, nullptr), "wait for messages");
    }
    const rcl_ret_t result = rcl_wait(&waiting_, std::chrono::nanoseconds(duration).count());
    if (result == RCL_RET_TIMEOUT) {
      rcl_reset_error();
      return rcl_context_is_valid(&context_);
    }
    check_rcl(result, "wait for messages");
    for (std::size_t index = 0; index < subscriptions.size(); ++index) {
      if (waiting_.subscriptions[index] != nullptr) subscriptions[index]->take_all(is_active_);
    }
    for (std::size_t index = 0; index < clients_.size(); ++index) {
      if (waiting_.clients[index] != nullptr) clients_[index]->take();
    }
    // Those of the lifecycle, which open and close the others, are last.
    for (std::size_t index = 0; index < servers.size(); ++index) {
      if (waiting_.services[index] != nullptr) servers[index].take();
    }
    return rcl_context_is_valid(&context_) && !(lifecycle_ && lifecycle_->is_finalized());
  }

  // Return the number of missing messages, by each publisher's numbers of the received ones.
  std::uint64_t lost() const {
    std::uint64_t sum = lost_;
    for (const auto& subscription : subscriptions_) sum += subscription->lost;
    return sum;
  }

  // Stop taking messages.
  void unsubscribe() {
    for (const auto& subscription : subscriptions_) lost_ += subscription->lost;
    for (auto& subscription : subscriptions_) ignore(rcl_subscription_fini(&subscription->rcl, &node_));
    subscriptions_.clear();
  }

  // Wait, for a limited time, until reliable peers have received all published messages.
  void flush() {
    const rcl_duration_value_t second = 1'000'000'000;
    for (auto& publisher : publishers_) ignore(rcl_publisher_wait_for_all_acked(&publisher->rcl, second));
  }

 private:
  // Return a function that publishes messages in every state of the node. Both throw MiddlewareError.
  MessageHandler advertise(const Topic& topic, const rmw_qos_profile_t& quality) {
    auto made = std::make_unique<Publisher>();
    made->type = topic.type;
    rcl_publisher_options_t options = rcl_publisher_get_default_options();
    options.qos = quality;
    check_rcl(rcl_publisher_init(&made->rcl, &node_, type_support(topic), topic.name.c_str(), &options),
              "advertise " + topic.name);
    publishers_.push_back(std::move(made));
    return [publisher = &publishers_.back()->rcl, name = topic.name](const std::uint8_t* data, std::size_t size) {
      rcl_serialized_message_t message = rmw_get_zero_initialized_serialized_message();
      // The buffer is only read; the structure serves both directions.
      message.buffer = const_cast<std::uint8_t*>(data);
      message.buffer_length = message.buffer_capacity = size;
      check_rcl(rcl_publish_serialized_message(publisher, &message, nullptr), "publish on " + name);
    };
  }

  // Put the lines of the node into ROS's log.
  void open_log() {
    const auto publish = advertise(own_topic("/rosout", "Log"), rcl_qos_profile_rosout_default);
    const std::string logger = rcl_node_get_logger_name(&node_);
    node_log().connect([publish, logger](Level level, const std::string& line) {
      if (!rcutils_logging_logger_is_enabled_for(logger.c_str(), static_cast<int>(level))) return;
      CdrWriter message;
      message.now().number(static_cast<std::uint8_t>(level)).text(logger).text(line).text("").text("");
      message.number(std::uint32_t{0});  // neither a file nor a function nor a line of the source
      try {
        publish(message.bytes.data(), message.bytes.size());
      } catch (const MiddlewareError&) {
        // The terminal has the line.
      }
    });
  }

  // Return a topic of each node of ROS 2, with a message of rcl_interfaces.
  static Topic own_topic(const std::string& name, const std::string& message) {
    Topic topic{};
    topic.name = name;
    topic.type = "rcl_interfaces/msg/" + message;
    return topic;
  }

  // Start or stop carrying messages. For clients, an inactive node has no services and actions. Throws
  // MiddlewareError.
  void change(bool is_active) {
    is_active_ = false;
    for (const auto& server : servers_) server->close();
    if (!is_active) return;
    try {
      for (const auto& server : servers_) server->open();
    } catch (const MiddlewareError&) {
      for (const auto& server : servers_) server->close();
      throw;
    }
    // Messages that ROS has replaced in its queues meanwhile do not count as lost.
    for (const auto& subscription : subscriptions_) subscription->gaps = Gaps();
    is_active_ = true;
  }

  // Return the services whose requests are taken.
  std::vector<Lifecycle::Server> waiting_servers() const {
    std::vector<Lifecycle::Server> found;
    if (!is_serving_) return found;
    for (const auto& server : parameter_servers_) {
      found.push_back({server->rcl(), [taken = server.get()] { taken->take(); }});
    }
    for (const auto& server : servers_) {
      if (server->is_open()) found.push_back({server->rcl(), [taken = server.get()] { taken->take(); }});
    }
    if (lifecycle_) found.insert(found.end(), lifecycle_->servers().begin(), lifecycle_->servers().end());
    return found;
  }

  // Return whether a name in a parameter file means this node: `*` matches a part of a name, `**` any parts.
  bool is_meant(std::string pattern) const {
    if (pattern.empty() || pattern[0] != '/') pattern = "/" + pattern;
    std::string expression;
    for (std::size_t place = 0; place < pattern.size(); ++place) {
      if (pattern.compare(place, 3, "/**") == 0) {
        expression += "(/\\w+)*";
        place += 2;
      } else {
        expression += pattern[place] == '*' ? "\\w+" : std::string(1, pattern[place]);
      }
    }
    return std::regex_match(rcl_node_get_fully_qualified_name(&node_), std::regex(expression));
  }

  // Return nothing for an array.
  static std::optional<std::string> text_of(const rcl_variant_t& value) {
    std::ostringstream text;
    if (value.bool_value != nullptr) {
      text << (*value.bool_value ? "true" : "false");
    } else if (value.integer_value != nullptr) {
      text << *value.integer_value;
    } else if (value.double_value != nullptr) {
      text.precision(17);
      text << *value.double_value;
    } else if (value.string_value != nullptr) {
      text << value.string_value;
    } else {
      return std::nullopt;
    }
    return text.str();
  }

  static constexpr std::chrono::seconds kLookInterval{1};

  struct Publisher {
    std::string type;
    rcl_publisher_t rcl = rcl_get_zero_initialized_publisher();
  };

  // A subscription with a buffer that grows to the largest message.
  struct Subscription {
    Subscription(const Quality& quality, std::string message_type, MessageHandler handle_message)
        : depth(quality.depth),
          is_transient_local(quality.is_transient_local),
          type(std::move(message_type)),
          handler(std::move(handle_message)) {
      const rcl_allocator_t allocator = rcl_get_default_allocator();
      check_rcl(rmw_serialized_message_init(&message, 0, &allocator), "allocate a message");
    }
    ~Subscription() { ignore(rmw_serialized_message_fini(&message)); }
    Subscription(const Subscription&) = delete;
    Subscription& operator=(const Subscription&) = delete;

    // Take at most the capacity of its queue, so that a peer that never stops does not starve others. An inactive node
    // ignores the messages.
    void take_all(bool is_active) {
      for (std::size_t number = 0; number < depth; ++number) {
        rmw_message_info_t info = rmw_get_zero_initialized_message_info();
        const rcl_ret_t result = rcl_take_serialized_message(&rcl, &message, &info, nullptr);
        if (result == RCL_RET_SUBSCRIPTION_TAKE_FAILED) return rcl_reset_error();
        check_rcl(result, "take a message");
        const std::uint64_t missing = count_missing(info);
        if (!is_active) continue;
        lost += missing;
        handler(message.buffer, message.buffer_length);
      }
    }

    // Return the number of missing messages before this one.
    std::uint64_t count_missing(const rmw_message_info_t& info) {
      if (info.publication_sequence_number == RMW_MESSAGE_INFO_SEQUENCE_NUMBER_UNSUPPORTED) return 0;
      const auto* bytes = reinterpret_cast<const char*>(info.publisher_gid.data);
      return gaps.missing(std::string(bytes, sizeof info.publisher_gid.data), info.publication_sequence_number);
    }

    const std::size_t depth;
    const bool is_transient_local;
    const std::string type;
    const MessageHandler handler;
    Gaps gaps;
    std::uint64_t lost = 0;
    rcl_subscription_t rcl = rcl_get_zero_initialized_subscription();
    rcl_serialized_message_t message = rmw_get_zero_initialized_serialized_message();
  };

  // Return the subscriptions whose messages are taken. Those of `transient_local` topics wait in ROS until the node is
  // active, since their publishers do not send them again.
  std::vector<Subscription*> waiting_subscriptions() const {
    std::vector<Subscription*> found;
    for (const auto& subscription : subscriptions_) {
      if (is_active_ || !subscription->is_transient_local) found.push_back(subscription.get());
    }
    return found;
  }

  static rmw_qos_profile_t profile(const Quality& quality) {
    rmw_qos_profile_t made = rmw_qos_profile_default;
    made.depth = quality.depth;
    made.reliability =
        quality.is_reliable ? RMW_QOS_POLICY_RELIABILITY_RELIABLE : RMW_QOS_POLICY_RELIABILITY_BEST_EFFORT;
    made.durability =
        quality.is_transient_local ? RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL : RMW_QOS_POLICY_DURABILITY_VOLATILE;
    return made;
  }

  // Report each node that uses a topic with another type, at intervals.
  void look_at_peers() {
    const auto now = std::chrono::steady_clock::now();
    if (now < looks_at_) return;
    looks_at_ = now + kLookInterval;
    for (const auto& subscription : subscriptions_) {
      const char* name = rcl_subscription_get_topic_name(&subscription->rcl);
      report_types(rcl_get_publishers_info_by_topic, "publishes", name, subscription->type);
    }
    for (const auto& publisher : publishers_) {
      const char* name = rcl_publisher_get_topic_name(&publisher->rcl);
      report_types(rcl_get_subscriptions_info_by_topic, "subscribes to", name, publisher->type);
    }
  }

  template <typename EndsOf>
  void report_types(EndsOf ends_of, const std::string& verb, const std::string& topic, const std::string& type) {
    rcl_allocator_t allocator = rcl_get_default_allocator();
    rmw_topic_endpoint_info_array_t ends = rmw_get_zero_initialized_topic_endpoint_info_array();
    if (ends_of(&node_, &allocator, topic.c_str(), false, &ends) != RCL_RET_OK) return rcl_reset_error();
    for (std::size_t index = 0; index < ends.size; ++index) {
      const auto& end = ends.info_array[index];
      if (end.topic_type == type || !is_due(end)) continue;
      const std::string report = std::string(end.node_name) + " " + verb + " " + topic + " with the type " +
                                 end.topic_type + ", which is " + type + " here; no messages are exchanged";
      if (reported_.insert(report).second) node_log().say(Level::kWarning, report);
    }
    ignore(rmw_topic_endpoint_info_array_fini(&ends, &allocator));
  }

  // Return whether an end of a topic is to be reported: once, and not before its node's name is available.
  bool is_due(const rmw_topic_endpoint_info_t& end) {
    const std::string gid(reinterpret_cast<const char*>(end.endpoint_gid), sizeof end.endpoint_gid);
    const bool is_nameless = std::string(end.node_name) == "_NODE_NAME_UNKNOWN_";
    if (told_.count(gid) || (is_nameless && nameless_.insert(gid).second)) return false;
    told_.insert(gid);
    return true;
  }

  void remove_ros_arguments(int& argc, char** argv) {
    const char** rest = nullptr;
    int count = 0;
    check_rcl(rcl_remove_ros_arguments(argv, &context_.global_arguments, rcl_get_default_allocator(), &count, &rest),
              "read the arguments");
    // The pointers refer to the strings of `argv`.
    for (int index = 0; index < count; ++index) argv[index] = const_cast<char*>(rest[index]);
    argc = count;
    if (rest != nullptr) rcl_get_default_allocator().deallocate(rest, nullptr);
  }

  std::string name_;
  bool is_started_ = false;
  std::uint64_t lost_ = 0;
  std::chrono::steady_clock::time_point looks_at_{};
  std::set<std::string> reported_;
  // The ends of topics that were reported, and those whose node was unknown at a look.
  std::set<std::string> told_;
  std::set<std::string> nameless_;
  rcl_context_t context_ = rcl_get_zero_initialized_context();
  rcl_node_t node_ = rcl_get_zero_initialized_node();
  rcl_wait_set_t waiting_ = rcl_get_zero_initialized_wait_set();
  std::vector<std::unique_ptr<Publisher>> publishers_;
  std::vector<std::unique_ptr<Subscription>> subscriptions_;
  bool is_serving_ = true;
  std::atomic<bool> is_active_{true};
  std::unique_ptr<Lifecycle> lifecycle_;
  std::vector<std::unique_ptr<RawServer>> servers_;
  std::unique_ptr<ParameterServices> parameters_;
  std::vector<std::unique_ptr<RawServer>> parameter_servers_;
  std::vector<std::unique_ptr<RawClient>> clients_;
};

}  // namespace firm
