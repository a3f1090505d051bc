// SPDX-License-Identifier: Apache-2.0
// ROS 1 as a carrier of bytes: roscpp without the classes of any message, so that a node needs no message package where it
// is compiled, and no message is parsed on its way.
//
//     firm::Ros1 ros(argc, argv, "quat2euler");                     // takes ROS' own arguments out of argv
//     ros.subscribe(topic, 10, [](const std::uint8_t* data, std::size_t size) { ... });
//     firm::MessageHandler publish = ros.advertise(topic, 10);      // any thread may call it
//     while (running) ros.spin(std::chrono::milliseconds(50));
//     ros.flush();
//
// C++17; `pkg-config --cflags --libs roscpp`.
#pragma once

#include <ros/ros.h>

#include <ros/callback_queue.h>
#include <ros/subscription_callback_helper.h>

#include <chrono>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <typeinfo>
#include <utility>
#include <vector>

#include <firm/topic.hpp>

namespace firm {

// A message that is on its way out, as roscpp's serialisation takes it.
struct RawMessage {
  const std::uint8_t* data;
  std::size_t size;
};

// What roscpp calls for a message that came in. It would have a message parsed; here its bytes are kept.
class RawCallback : public ros::SubscriptionCallbackHelper {
 public:
  explicit RawCallback(MessageHandler handler) : handler_(std::move(handler)) {}

  // roscpp keeps the bytes no longer than this call; the result may be shared by several subscriptions of a topic.
  ros::VoidConstPtr deserialize(const ros::SubscriptionCallbackHelperDeserializeParams& received) override {
    return boost::make_shared<const Bytes>(received.buffer, received.buffer + received.length);
  }

  void call(ros::SubscriptionCallbackHelperCallParams& params) override {
    const auto& bytes = *static_cast<const Bytes*>(params.event.getMessage().get());
    handler_(bytes.data(), bytes.size());
  }

  const std::type_info& getTypeInfo() override { return typeid(Bytes); }
  bool isConst() override { return true; }
  // A header's sequence number is the publisher's own.
  bool hasHeader() override { return false; }

 private:
  using Bytes = std::vector<std::uint8_t>;
  MessageHandler handler_;
};

// A node of ROS 1.
class Ros1 {
 public:
  static constexpr bool kHasQuality = false;
  static constexpr const char* kArguments = "ROS' own arguments: NAME:=VALUE remaps a topic, __name:=, __ns:=, __log:=";

  // Takes ROS' own arguments out of `argv`. `name` is that of the node unless `__name:=` gives another.
  Ros1(int& argc, char** argv, const std::string& name) {
    ros::init(argc, argv, name, ros::init_options::NoSigintHandler);
  }

  ~Ros1() {
    subscribers_.clear();
    ros::shutdown();
  }

  Ros1(const Ros1&) = delete;
  Ros1& operator=(const Ros1&) = delete;

  // Become a node; `is_stopped` is asked while there is no master yet. Whether it is one.
  bool start(const std::function<bool()>& is_stopped) {
    for (bool is_first = true; !ros::master::check(); is_first = false) {
      if (is_first) ROS_WARN("waiting for a master at %s", ros::master::getURI().c_str());
      if (is_stopped()) return false;
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    node_ = std::make_unique<ros::NodeHandle>();
    node_->setCallbackQueue(&callbacks_);
    return true;
  }

  // Hand every message of a topic to `handler`, in the thread that calls spin().
  void subscribe(const Topic& topic, std::size_t depth, MessageHandler handler) {
    ros::SubscribeOptions options(topic.name, static_cast<std::uint32_t>(depth), topic.signature, topic.type);
    options.helper = boost::make_shared<RawCallback>(std::move(handler));
    // A small message is not to wait for the next one.
    options.transport_hints.tcpNoDelay();
    subscribers_.push_back(node_->subscribe(options));
  }

  // A function that publishes messages of a topic.
  MessageHandler advertise(const Topic& topic, std::size_t depth) {
    ros::AdvertiseOptions options(topic.name, static_cast<std::uint32_t>(depth), topic.signature, topic.type,
                                  topic.definition);
    return [publisher = node_->advertise(options)](const std::uint8_t* data, std::size_t size) {
      publisher.publish(RawMessage{data, size});
    };
  }

  // Handle what comes, for about `duration`. False if ROS wants the node to end.
  bool spin(std::chrono::milliseconds duration) {
    callbacks_.callAvailable(ros::WallDuration(std::chrono::duration<double>(duration).count()));
    return ros::ok();
  }

  // Take no more messages.
  void unsubscribe() { subscribers_.clear(); }

  // Give what has been published the time to leave: roscpp sends in a thread of its own and does not say when it is done.
  void flush() { std::this_thread::sleep_for(std::chrono::milliseconds(300)); }

 private:
  ros::CallbackQueue callbacks_;
  std::unique_ptr<ros::NodeHandle> node_;
  std::vector<ros::Subscriber> subscribers_;
};

}  // namespace firm

// For roscpp a RawMessage is of any type: its topic has been advertised with one.
namespace ros::message_traits {

template <>
struct MD5Sum<firm::RawMessage> {
  static const char* value() { return "*"; }
  static const char* value(const firm::RawMessage&) { return "*"; }
};

template <>
struct DataType<firm::RawMessage> {
  static const char* value() { return "*"; }
  static const char* value(const firm::RawMessage&) { return "*"; }
};

}  // namespace ros::message_traits

namespace ros::serialization {

template <>
struct Serializer<firm::RawMessage> {
  template <typename Stream>
  static void write(Stream& stream, const firm::RawMessage& message) {
    if (message.size > 0) std::memcpy(stream.advance(static_cast<std::uint32_t>(message.size)), message.data, message.size);
  }
  static std::uint32_t serializedLength(const firm::RawMessage& message) {
    return static_cast<std::uint32_t>(message.size);
  }
};

}  // namespace ros::serialization
