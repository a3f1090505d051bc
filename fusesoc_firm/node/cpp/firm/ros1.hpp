// SPDX-License-Identifier: Apache-2.0
// ROS 1 as a carrier of bytes: roscpp without message classes. A node therefore needs no message packages to compile,
// and messages are never parsed.
//
//     firm::Ros1 ros(argc, argv, "quat2euler");                     // removes ROS's own arguments from argv
//     ros.subscribe(topic, topic.quality, [](const std::uint8_t* data, std::size_t size) { ... });
//     firm::MessageHandler publish = ros.advertise(topic, topic.quality);  // any thread may call it
//     while (running) ros.spin(std::chrono::milliseconds(50));
//     ros.flush();
//
// C++17; `pkg-config --cflags --libs roscpp`.
#pragma once

#include <ros/ros.h>

#include <ros/callback_queue.h>
#include <ros/subscription_callback_helper.h>
#include <rosgraph_msgs/Log.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <typeinfo>
#include <utility>
#include <variant>
#include <vector>

#include <firm/log.hpp>
#include <firm/parameters.hpp>
#include <firm/ros1_services.hpp>
#include <firm/topic.hpp>

namespace firm {

// An outgoing message, in the form that roscpp serialises.
struct RawMessage {
  const std::uint8_t* data;
  std::size_t size;
};

// The handler that roscpp calls for an incoming message. Instead of parsing the message, it keeps the bytes.
class RawCallback : public ros::SubscriptionCallbackHelper {
 public:
  // `count_missing` is called with the publisher and the bytes of each message.
  using CountMissing = std::function<void(const std::string& publisher, const std::uint8_t* data, std::size_t size)>;

  RawCallback(MessageHandler handler, CountMissing count_missing)
      : handler_(std::move(handler)), count_missing_(std::move(count_missing)) {}

  // roscpp keeps the bytes only during this call; several subscriptions of a topic may share the result.
  ros::VoidConstPtr deserialize(const ros::SubscriptionCallbackHelperDeserializeParams& received) override {
    return boost::make_shared<const Bytes>(received.buffer, received.buffer + received.length);
  }

  void call(ros::SubscriptionCallbackHelperCallParams& params) override {
    const auto& bytes = *static_cast<const Bytes*>(params.event.getMessage().get());
    count_missing_(params.event.getPublisherName(), bytes.data(), bytes.size());
    handler_(bytes.data(), bytes.size());
  }

  const std::type_info& getTypeInfo() override { return typeid(Bytes); }
  bool isConst() override { return true; }
  // The sequence number in a header belongs to its publisher.
  bool hasHeader() override { return false; }

 private:
  using Bytes = std::vector<std::uint8_t>;
  MessageHandler handler_;
  CountMissing count_missing_;
};

// A node of ROS 1.
class Ros1 {
 public:
  static constexpr unsigned kVersion = 1;
  // Only messages with a Header have numbers.
  static constexpr bool kCountsDrops = false;
  static constexpr std::size_t kUnlimited = 0;
  static constexpr const char* kArguments = "ROS arguments: NAME:=VALUE remaps a topic, __name:=, __ns:=, __log:=";

  // Remove ROS's own arguments from `argv`. The node is called `name` unless `__name:=` is given.
  Ros1(int& argc, char** argv, const std::string& name) {
    ros::init(argc, argv, name, ros::init_options::NoSigintHandler);
  }

  ~Ros1() {
    node_log().connect({});
    subscribers_.clear();
    servers_.clear();
    // This ends calls of servers that do not answer.
    ros::shutdown();
    clients_.clear();
  }

  Ros1(const Ros1&) = delete;
  Ros1& operator=(const Ros1&) = delete;

  // Become a node; call `is_stopped` while waiting for a master. Return whether the node has started.
  bool start(const std::function<bool()>& is_stopped) {
    for (bool is_first = true; !ros::master::check(); is_first = false) {
      if (is_first) ROS_WARN("waiting for a master at %s", ros::master::getURI().c_str());
      if (is_stopped()) return false;
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    node_ = std::make_unique<ros::NodeHandle>();
    node_->setCallbackQueue(&callbacks_);
    const auto log = node_->advertise<rosgraph_msgs::Log>("/rosout", kLogDepth, true);
    node_log().connect([log](Level level, const std::string& line) { log.publish(log_message(level, line)); });
    return true;
  }

  // Return the private parameters of the node with these names that are set, as texts.
  std::map<std::string, std::string> parameters(const std::vector<std::string>& names) const {
    std::map<std::string, std::string> found;
    for (const auto& name : names) {
      XmlRpc::XmlRpcValue value;
      if (ros::param::get(private_name(name), value)) found[name] = text_of(value);
    }
    return found;
  }

  // Let the private parameters in the master set those of the hardware; both outlive the node.
  void offer(HardwareParameters& parameters, SetParameters set) {
    parameters_ = &parameters;
    set_ = std::move(set);
    for (const auto& [name, value] : parameters.values()) put_back(name, value);
  }

  // Pass every message of a topic to `handler`, in the thread that calls spin().
  void subscribe(const Topic& topic, const Quality& quality, MessageHandler handler) {
    ros::SubscribeOptions options(topic.name, static_cast<std::uint32_t>(quality.depth), topic.signature, topic.type);
    const auto count_missing = [this, gaps = Gaps(), is_numbered = topic.is_numbered](
                                   const std::string& publisher, const std::uint8_t* data, std::size_t size) mutable {
      if (is_numbered && size >= 4) lost_ += gaps.missing(publisher, number_at(data));
    };
    options.helper = boost::make_shared<RawCallback>(std::move(handler), count_missing);
    // Send small messages at once, without waiting for the next one.
    options.transport_hints.tcpNoDelay();
    types_[node_->resolveName(topic.name)] = topic.type;
    subscribers_.push_back(node_->subscribe(options));
  }

  // Return whether a topic to which the node subscribes is connected to a publisher.
  bool has_publisher(const Topic& topic) const {
    const std::string name = node_->resolveName(topic.name);
    return std::any_of(subscribers_.begin(), subscribers_.end(), [&name](const ros::Subscriber& subscriber) {
      return subscriber.getTopic() == name && subscriber.getNumPublishers() > 0;
    });
  }

  // Return whether a topic that the node advertises is connected to a subscriber.
  bool has_subscriber(const Topic& topic) const {
    const std::string name = node_->resolveName(topic.name);
    return std::any_of(publishers_.begin(), publishers_.end(), [&name](const ros::Publisher& publisher) {
      return publisher.getTopic() == name && publisher.getNumSubscribers() > 0;
    });
  }

  // Return a function that publishes messages of a topic.
  MessageHandler advertise(const Topic& topic, const Quality& quality) {
    ros::AdvertiseOptions options(topic.name, static_cast<std::uint32_t>(quality.depth), topic.signature, topic.type,
                                  topic.definition);
    options.latch = quality.is_transient_local;
    types_[node_->resolveName(topic.name)] = topic.type;
    publishers_.push_back(node_->advertise(options));
    return [publisher = publishers_.back()](const std::uint8_t* data, std::size_t size) {
      publisher.publish(RawMessage{data, size});
    };
  }

  // Pass every call of a service to `handler`, in a thread of the service.
  void serve(const Service& service, CallHandler handler) {
    servers_.push_back(std::make_unique<RawServer>(*node_, service, std::move(handler)));
  }

  // Return a function that calls a service.
  CallHandler caller(const Service& service) {
    clients_.push_back(std::make_unique<RawClient>(*node_, service));
    return [client = clients_.back().get()](Bytes payload, AnswerHandler answer) {
      client->put(std::move(payload), std::move(answer));
    };
  }

  // Handle messages during `drain`, which waits until all calls are answered.
  void spin_during(const std::function<void()>& drain) { drain(); }

  // Stop serving and answering calls, since the handlers may end.
  void stop_calls() {
    servers_.clear();
    for (const auto& client : clients_) client->stop();
  }

  // Handle incoming messages for about `duration`. Returns false if ROS asks the node to end.
  bool spin(std::chrono::milliseconds duration) {
    look_at_types();
    look_at_parameters();
    callbacks_.callAvailable(ros::WallDuration(std::chrono::duration<double>(duration).count()));
    return ros::ok();
  }

  // Return the number of missing messages, by the numbers in the headers of the received ones.
  std::uint64_t lost() const { return lost_; }

  // Stop taking messages.
  void unsubscribe() { subscribers_.clear(); }

  // Give published messages time to leave: roscpp sends them in its own thread and does not report completion.
  void flush() { std::this_thread::sleep_for(std::chrono::milliseconds(300)); }

 private:
  static constexpr std::uint32_t kLogDepth = 1000;

  static rosgraph_msgs::Log log_message(Level level, const std::string& line) {
    rosgraph_msgs::Log message;
    message.header.stamp = ros::Time::now();
    message.level = level == Level::kInfo      ? rosgraph_msgs::Log::INFO
                    : level == Level::kWarning ? rosgraph_msgs::Log::WARN
                                               : rosgraph_msgs::Log::ERROR;
    message.name = ros::this_node::getName();
    message.msg = line;
    ros::this_node::getAdvertisedTopics(message.topics);
    return message;
  }

  // Return the name in the master, whose parts are separated by slashes.
  static std::string private_name(std::string name) {
    std::replace(name.begin(), name.end(), '.', '/');
    return "~" + name;
  }

  static std::string text_of(XmlRpc::XmlRpcValue& value) {
    std::ostringstream text;
    if (value.getType() == XmlRpc::XmlRpcValue::TypeBoolean) {
      text << (static_cast<bool>(value) ? "true" : "false");
    } else if (value.getType() == XmlRpc::XmlRpcValue::TypeDouble) {
      text.precision(17);
      text << static_cast<double>(value);
    } else if (value.getType() == XmlRpc::XmlRpcValue::TypeString) {
      text << static_cast<std::string>(value);
    } else {
      text << value;
    }
    return text.str();
  }

  // Store the value in effect in the master.
  static void put_back(const std::string& name, const ParameterValue& value) {
    const std::string key = private_name(name);
    if (const auto* truth = std::get_if<bool>(&value)) return ros::param::set(key, *truth);
    if (const auto* real = std::get_if<double>(&value)) return ros::param::set(key, *real);
    ros::param::set(key, static_cast<int>(std::get<std::int64_t>(value)));
  }

  // Set the parameters that have changed in the master, at intervals; the master gets back a value that is refused.
  void look_at_parameters() {
    const auto now = std::chrono::steady_clock::now();
    if (!parameters_ || now < looks_at_parameters_) return;
    looks_at_parameters_ = now + std::chrono::milliseconds(100);
    for (const auto& parameter : parameters_->parameters()) {
      XmlRpc::XmlRpcValue found;
      if (!ros::param::getCached(private_name(parameter.name), found)) continue;
      const ParameterValue before = parameters_->values().at(parameter.name);
      std::string reason;
      try {
        const ParameterValue wanted = parameter.value(text_of(found));
        if (parameter.own(wanted) == before) continue;
        reason = set_({{parameter.name, wanted}});
      } catch (const std::invalid_argument& fault) {
        reason = fault.what();
      }
      if (reason.empty()) continue;
      node_log().say(Level::kWarning, "the parameter " + private_name(parameter.name) + " is not set: " + reason);
      put_back(parameter.name, before);
    }
  }

  // The `seq` of a Header, which is little-endian on the wire.
  static std::uint64_t number_at(const std::uint8_t* data) {
    return data[0] | data[1] << 8 | data[2] << 16 | static_cast<std::uint64_t>(data[3]) << 24;
  }

  // Report each topic that another node uses with another type, at intervals.
  void look_at_types() {
    const auto now = std::chrono::steady_clock::now();
    if (now < looks_at_) return;
    looks_at_ = now + std::chrono::seconds(1);
    XmlRpc::XmlRpcValue request, response, topics;
    request[0] = ros::this_node::getName();
    request[1] = "";
    // `false`: do not wait for a master that has ended.
    if (!ros::master::execute("getPublishedTopics", request, response, topics, false)) return;
    for (int index = 0; index < topics.size(); ++index) {
      const std::string name = topics[index][0], found = topics[index][1];
      const auto known = types_.find(name);
      if (known == types_.end() || found == "*" || found == known->second) continue;
      const std::string report = "another node uses " + name + " with the type " + found + ", which is " +
                                 known->second + " here; no messages are exchanged";
      if (reported_.insert(report).second) node_log().say(Level::kWarning, report);
    }
  }

  std::uint64_t lost_ = 0;
  std::map<std::string, std::string> types_;
  std::set<std::string> reported_;
  std::chrono::steady_clock::time_point looks_at_{};
  HardwareParameters* parameters_ = nullptr;
  SetParameters set_;
  std::chrono::steady_clock::time_point looks_at_parameters_{};
  ros::CallbackQueue callbacks_;
  std::unique_ptr<ros::NodeHandle> node_;
  std::vector<ros::Subscriber> subscribers_;
  std::vector<ros::Publisher> publishers_;
  std::vector<std::unique_ptr<RawServer>> servers_;
  std::vector<std::unique_ptr<RawClient>> clients_;
};

}  // namespace firm

// To roscpp, a RawMessage is of any type; its topic is advertised with a concrete one.
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
