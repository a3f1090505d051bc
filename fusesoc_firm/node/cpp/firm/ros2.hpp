// SPDX-License-Identifier: Apache-2.0
// ROS 2 as a carrier of bytes: rcl with serialised messages. The node looks up the type support of messages at run
// time, so it needs no message packages to compile, and messages are never parsed.
//
//     firm::Ros2 ros(argc, argv, "quat2euler");                     // removes ROS's own arguments from argv
//     ros.subscribe(topic, 10, [](const std::uint8_t* data, std::size_t size) { ... });
//     firm::MessageHandler publish = ros.advertise(topic, 10);      // any thread may call it
//     while (running) ros.spin(std::chrono::milliseconds(50));
//     ros.flush();
//
// C++17; rcl is part of every ROS 2.
#pragma once

#include <dlfcn.h>
#include <rcl/arguments.h>
#include <rcl/error_handling.h>
#include <rcl/init.h>
#include <rcl/init_options.h>
#include <rcl/logging.h>
#include <rcl/node.h>
#include <rcl/publisher.h>
#include <rcl/subscription.h>
#include <rcl/wait.h>
#include <rcutils/logging_macros.h>
#if __has_include(<rosidl_runtime_c/type_hash.h>)  // since Iron
#include <rosidl_runtime_c/type_hash.h>
#define FIRM_HAS_TYPE_HASH
#endif

#include <chrono>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <firm/topic.hpp>

namespace firm {

// Throw MiddlewareError for any result except RCL_RET_OK; `what` names the attempted action.
inline void check_rcl(rcl_ret_t result, const std::string& what) {
  if (result == RCL_RET_OK) return;
  const std::string reason = rcl_get_error_string().str;
  rcl_reset_error();
  throw MiddlewareError("cannot " + what + ": " + reason);
}

// For cleanup calls, whose failure cannot be handled.
inline void ignore(rcl_ret_t) { rcl_reset_error(); }

// Return the type support of a type such as `geometry_msgs/msg/Quaternion`, from the library of its package. Throws
// MiddlewareError if the package is not installed, or if its definition differs from that of `topic`.
inline const rosidl_message_type_support_t* type_support(const Topic& topic) {
  const std::string package = topic.type.substr(0, topic.type.find('/'));
  const std::string library = "lib" + package + "__rosidl_typesupport_c.so";
  std::string symbol = "rosidl_typesupport_c__get_message_type_support_handle__";
  for (const char letter : topic.type) symbol += letter == '/' ? "__" : std::string(1, letter);
  // Never closed: publishers and subscriptions point into the library as long as the process runs.
  void* handle = dlopen(library.c_str(), RTLD_LAZY | RTLD_LOCAL);
  if (handle == nullptr) {
    throw MiddlewareError("the message " + topic.type + " of " + topic.name + " is not installed: " + dlerror() +
                          "; source ROS and the workspace with " + package);
  }
  using Get = const rosidl_message_type_support_t* (*)();
  const auto get = reinterpret_cast<Get>(dlsym(handle, symbol.c_str()));
  if (get == nullptr) {
    throw MiddlewareError(library + " does not contain the message " + topic.type + ", which " + topic.name + " needs");
  }
  const rosidl_message_type_support_t* support = get();
#ifdef FIRM_HAS_TYPE_HASH
  rosidl_type_hash_t expected;
  if (rosidl_parse_type_hash_string(topic.signature.c_str(), &expected) != RCUTILS_RET_OK) {
    rcl_reset_error();
    throw MiddlewareError("'" + topic.signature + "', the signature of " + topic.name + ", is not a type hash");
  }
  const rosidl_type_hash_t* installed = support->get_type_hash_func(support);
  if (installed->version != expected.version || std::memcmp(installed->value, expected.value, sizeof expected.value) != 0) {
    throw MiddlewareError("the message " + topic.type + " is installed in a version that differs from the hardware's (" +
                          topic.signature + ")");
  }
#endif
  return support;
}

// A node of ROS 2.
class Ros2 {
 public:
  static constexpr bool kHasQuality = true;
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
    unsubscribe();
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
    const rcl_node_options_t options = rcl_node_get_default_options();
    check_rcl(rcl_node_init(&node_, name_.c_str(), "", &context_, &options), "create the node " + name_);
    check_rcl(rcl_wait_set_init(&waiting_, 0, 0, 0, 0, 0, 0, &context_, allocator), "wait for messages");
    is_started_ = true;
    return true;
  }

  // Pass every message of a topic to `handler`, in the thread that calls spin(). Throws MiddlewareError.
  void subscribe(const Topic& topic, std::size_t depth, MessageHandler handler) {
    auto made = std::make_unique<Subscription>(depth, std::move(handler));
    rcl_subscription_options_t options = rcl_subscription_get_default_options();
    options.qos = quality(depth);
    check_rcl(rcl_subscription_init(&made->rcl, &node_, type_support(topic), topic.name.c_str(), &options),
              "subscribe to " + topic.name);
    subscriptions_.push_back(std::move(made));
    check_rcl(rcl_wait_set_resize(&waiting_, subscriptions_.size(), 0, 0, 0, 0, 0), "wait for messages");
  }

  // Return a function that publishes messages of a topic. Both this call and the function throw MiddlewareError.
  MessageHandler advertise(const Topic& topic, std::size_t depth) {
    auto made = std::make_unique<Publisher>();
    rcl_publisher_options_t options = rcl_publisher_get_default_options();
    options.qos = quality(depth);
    check_rcl(rcl_publisher_init(&made->rcl, &node_, type_support(topic), topic.name.c_str(), &options),
              "advertise " + topic.name);
    publishers_.push_back(std::move(made));
    return [publisher = &publishers_.back()->rcl, name = topic.name](const std::uint8_t* data, std::size_t size) {
      rcl_serialized_message_t message = rmw_get_zero_initialized_serialized_message();
      // It is only read; the structure serves both directions.
      message.buffer = const_cast<std::uint8_t*>(data);
      message.buffer_length = message.buffer_capacity = size;
      check_rcl(rcl_publish_serialized_message(publisher, &message, nullptr), "publish on " + name);
    };
  }

  // Handle incoming messages for about `duration`. Returns false if ROS asks the node to end. Throws MiddlewareError.
  bool spin(std::chrono::milliseconds duration) {
    if (subscriptions_.empty()) {
      // rcl does not wait on an empty set.
      std::this_thread::sleep_for(duration);
      return rcl_context_is_valid(&context_);
    }
    check_rcl(rcl_wait_set_clear(&waiting_), "wait for messages");
    for (const auto& subscription : subscriptions_) {
      check_rcl(rcl_wait_set_add_subscription(&waiting_, &subscription->rcl, nullptr), "wait for messages");
    }
    const rcl_ret_t result = rcl_wait(&waiting_, std::chrono::nanoseconds(duration).count());
    if (result == RCL_RET_TIMEOUT) {
      rcl_reset_error();
      return rcl_context_is_valid(&context_);
    }
    check_rcl(result, "wait for messages");
    for (std::size_t index = 0; index < subscriptions_.size(); ++index) {
      if (waiting_.subscriptions[index] != nullptr) subscriptions_[index]->take_all();
    }
    return rcl_context_is_valid(&context_);
  }

  // Take no more messages.
  void unsubscribe() {
    for (auto& subscription : subscriptions_) ignore(rcl_subscription_fini(&subscription->rcl, &node_));
    subscriptions_.clear();
  }

  // Wait, for a limited time, until reliable peers have received all published messages.
  void flush() {
    const rcl_duration_value_t second = 1'000'000'000;
    for (auto& publisher : publishers_) ignore(rcl_publisher_wait_for_all_acked(&publisher->rcl, second));
  }

  // Also take messages from peers that do not promise delivery (sensors), and make no such promise.
  void be_best_effort() { reliability_ = RMW_QOS_POLICY_RELIABILITY_BEST_EFFORT; }

 private:
  struct Publisher {
    rcl_publisher_t rcl = rcl_get_zero_initialized_publisher();
  };

  // A subscription with a buffer that grows to the largest message.
  struct Subscription {
    Subscription(std::size_t most, MessageHandler handle_message) : depth(most), handler(std::move(handle_message)) {
      const rcl_allocator_t allocator = rcl_get_default_allocator();
      check_rcl(rmw_serialized_message_init(&message, 0, &allocator), "allocate a message");
    }
    ~Subscription() { ignore(rmw_serialized_message_fini(&message)); }
    Subscription(const Subscription&) = delete;
    Subscription& operator=(const Subscription&) = delete;

    // Take no more than its queue holds, so that a peer that never stops does not starve others.
    void take_all() {
      for (std::size_t number = 0; number < depth; ++number) {
        const rcl_ret_t result = rcl_take_serialized_message(&rcl, &message, nullptr, nullptr);
        if (result == RCL_RET_SUBSCRIPTION_TAKE_FAILED) return rcl_reset_error();
        check_rcl(result, "take a message");
        handler(message.buffer, message.buffer_length);
      }
    }

    const std::size_t depth;
    const MessageHandler handler;
    rcl_subscription_t rcl = rcl_get_zero_initialized_subscription();
    rcl_serialized_message_t message = rmw_get_zero_initialized_serialized_message();
  };

  rmw_qos_profile_t quality(std::size_t depth) const {
    rmw_qos_profile_t profile = rmw_qos_profile_default;
    profile.depth = depth;
    profile.reliability = reliability_;
    return profile;
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
  rmw_qos_reliability_policy_t reliability_ = RMW_QOS_POLICY_RELIABILITY_RELIABLE;
  rcl_context_t context_ = rcl_get_zero_initialized_context();
  rcl_node_t node_ = rcl_get_zero_initialized_node();
  rcl_wait_set_t waiting_ = rcl_get_zero_initialized_wait_set();
  std::vector<std::unique_ptr<Publisher>> publishers_;
  std::vector<std::unique_ptr<Subscription>> subscriptions_;
};

}  // namespace firm
