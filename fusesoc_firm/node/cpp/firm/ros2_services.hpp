// SPDX-License-Identifier: Apache-2.0
// Services of ROS 2 as bytes: rcl takes and sends structures, which are created, serialised and destroyed by functions
// that are looked up at run time. C++17; rcl is part of every ROS 2.
#pragma once

#include <dlfcn.h>
#include <rcl/client.h>
#include <rcl/graph.h>
#include <rcl/service.h>
#include <rmw/rmw.h>

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include <firm/log.hpp>
#include <firm/rcl.hpp>
#include <firm/services.hpp>
#include <firm/topic.hpp>

namespace firm {

// Return a function of the middleware. rcl has loaded the middleware, but nodes do not link to it: its library differs
// between installations. Throws MiddlewareError.
template <typename Function>
Function* middleware_function(const char* name) {
  void* found = dlsym(RTLD_DEFAULT, name);
  if (found == nullptr) throw MiddlewareError(std::string("the middleware has no function ") + name);
  return reinterpret_cast<Function*>(found);
}

// A message of a service as rcl takes it.
class TypedMessage {
 public:
  // `type` is the message's type, such as `std_srvs/srv/SetBool_Request`. Both constructors throw MiddlewareError.
  TypedMessage(const std::string& type, const std::string& service) : TypedMessage({"message", type, service}) {}

  explicit TypedMessage(const TypeName& type)
      : support_(message_support(type)),
        create_(function_of<void* (*)()>(type, "__create")),
        destroy_(function_of<void (*)(void*)>(type, "__destroy")),
        structure_(create_()) {
    if (structure_ == nullptr) throw MiddlewareError("there is no memory for a message of " + type.user);
  }

  ~TypedMessage() { destroy_(structure_); }

  TypedMessage(const TypedMessage&) = delete;
  TypedMessage& operator=(const TypedMessage&) = delete;

  void* structure() { return structure_; }

  // Throws MiddlewareError.
  Bytes serialised() const {
    const rcl_allocator_t allocator = rcl_get_default_allocator();
    rmw_serialized_message_t message = rmw_get_zero_initialized_serialized_message();
    check_rcl(rmw_serialized_message_init(&message, 0, &allocator), "allocate a message");
    const rmw_ret_t result =
        middleware_function<decltype(rmw_serialize)>("rmw_serialize")(structure_, support_, &message);
    Bytes bytes(message.buffer, message.buffer + message.buffer_length);
    ignore(rmw_serialized_message_fini(&message));
    check_rcl(result, "serialise a message");
    return bytes;
  }

  // Throws MiddlewareError.
  void deserialise(const Bytes& bytes) {
    rmw_serialized_message_t message = rmw_get_zero_initialized_serialized_message();
    // The buffer is only read; the structure serves both directions.
    message.buffer = const_cast<std::uint8_t*>(bytes.data());
    message.buffer_length = message.buffer_capacity = bytes.size();
    const auto deserialize = middleware_function<decltype(rmw_deserialize)>("rmw_deserialize");
    check_rcl(deserialize(&message, support_, structure_), "deserialise a message");
  }

 private:
  template <typename Function>
  static Function function_of(const TypeName& type, const std::string& suffix) {
    return reinterpret_cast<Function>(symbol(type, "__rosidl_generator_c.so", "", suffix));
  }

  const rosidl_message_type_support_t* support_;
  void* (*create_)();
  void (*destroy_)(void*);
  void* structure_;
};

// The capacity of the queues of services, in messages. Each client receives the responses to all clients, so the default of
// 10 is too few on a busy machine.
constexpr std::size_t kServiceDepth = 1000;

// A server of the hardware, which clients see while it is open. Answers come from any thread; the thread that spins calls
// the other functions.
class RawServer {
 public:
  // Throws MiddlewareError.
  RawServer(rcl_node_t& node, const Service& service, CallHandler handler)
      : node_(node), service_(service), handler_(std::move(handler)), support_(service_support(service)) {}

  ~RawServer() { close(); }

  // Throws MiddlewareError.
  void open() {
    rcl_service_options_t options = rcl_service_get_default_options();
    options.qos.depth = kServiceDepth;
    const std::lock_guard<std::mutex> lock(mutex_);
    check_rcl(rcl_service_init(&rcl_, &node_, support_, service_.name.c_str(), &options), "serve " + service_.name);
    is_open_ = true;
    ++opening_;
  }

  // Open calls get no answer.
  void close() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (std::exchange(is_open_, false)) ignore(rcl_service_fini(&rcl_, &node_));
  }

  bool is_open() const { return is_open_; }

  RawServer(const RawServer&) = delete;
  RawServer& operator=(const RawServer&) = delete;

  const rcl_service_t* rcl() const { return &rcl_; }

  // Take a request. Throws MiddlewareError.
  void take() {
    TypedMessage request(service_.request_type, service_.name);
    rmw_request_id_t header{};
    const rcl_ret_t result = rcl_take_request(&rcl_, &header, request.structure());
    if (result == RCL_RET_SERVICE_TAKE_FAILED) return rcl_reset_error();
    check_rcl(result, "take a request of " + service_.name);
    handler_(request.serialised(),
             [this, header, opening = opening_](const Answer& answer) { respond(header, opening, answer); });
  }

 private:
  // ROS 2 has no answer for a call that fails. A call from before the last opening gets no answer either.
  void respond(rmw_request_id_t header, unsigned opening, const Answer& answer) {
    if (!answer.payload) return;
    try {
      TypedMessage response(service_.response_type, service_.name);
      response.deserialise(*answer.payload);
      const std::lock_guard<std::mutex> lock(mutex_);
      if (!is_open_ || opening != opening_) return;
      check_rcl(rcl_send_response(&rcl_, &header, response.structure()), "respond to a call of " + service_.name);
    } catch (const MiddlewareError& error) {
      // The client has ended, or the response is malformed.
      node_log().say(Level::kWarning, error.what());
    }
  }

  rcl_node_t& node_;
  const Service service_;
  const CallHandler handler_;
  const rosidl_service_type_support_t* const support_;
  std::mutex mutex_;  // protects the members below while answers come
  bool is_open_ = false;
  unsigned opening_ = 0;
  rcl_service_t rcl_ = rcl_get_zero_initialized_service();
};

// A client of the hardware, which keeps the latest calls, since goals may be accepted late. take() is called by the
// thread that spins.
class RawClient {
 public:
  // The calls that may be answered late.
  static constexpr std::size_t kMostPending = 100;

  // Throws MiddlewareError.
  RawClient(rcl_node_t& node, const Service& service) : node_(node), service_(service) {
    rcl_client_options_t options = rcl_client_get_default_options();
    options.qos.depth = kServiceDepth;
    check_rcl(rcl_client_init(&rcl_, &node_, service_support(service), service.name.c_str(), &options),
              "call " + service.name);
  }

  ~RawClient() { ignore(rcl_client_fini(&rcl_, &node_)); }

  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  const rcl_client_t* rcl() const { return &rcl_; }

  // Call the service. Any thread may call this function.
  void call(const Bytes& payload, AnswerHandler answer) {
    try {
      bool is_there = false;
      check_rcl(rcl_service_server_is_available(&node_, &rcl_, &is_there), "look for " + service_.name);
      if (!is_there) return answer({std::nullopt, "there is no server of " + service_.name});
      TypedMessage request(service_.request_type, service_.name);
      request.deserialise(payload);
      // The response may arrive before rcl_send_request() returns.
      const std::lock_guard<std::mutex> lock(mutex_);
      std::int64_t number = 0;
      check_rcl(rcl_send_request(&rcl_, request.structure(), &number), "call " + service_.name);
      answers_[number] = std::move(answer);
      if (answers_.size() > kMostPending) answers_.erase(answers_.begin());
    } catch (const MiddlewareError& error) {
      answer({std::nullopt, error.what()});
    }
  }

  // Stop giving answers.
  void stop() {
    const std::lock_guard<std::mutex> lock(mutex_);
    answers_.clear();
  }

  // Take a response. Throws MiddlewareError.
  void take() {
    TypedMessage response(service_.response_type, service_.name);
    rmw_request_id_t header{};
    const rcl_ret_t result = rcl_take_response(&rcl_, &header, response.structure());
    if (result == RCL_RET_CLIENT_TAKE_FAILED) return rcl_reset_error();
    check_rcl(result, "take a response of " + service_.name);
    AnswerHandler answer;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (auto found = answers_.extract(header.sequence_number)) answer = std::move(found.mapped());
    }
    if (answer) answer({response.serialised()});
  }

 private:
  rcl_node_t& node_;
  const Service service_;
  rcl_client_t rcl_ = rcl_get_zero_initialized_client();
  std::mutex mutex_;  // protects the members below
  std::map<std::int64_t, AnswerHandler> answers_;  // by the numbers of the calls
};

}  // namespace firm
