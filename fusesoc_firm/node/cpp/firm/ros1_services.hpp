// SPDX-License-Identifier: Apache-2.0
// Services of ROS 1 as bytes: roscpp without message classes. C++17; `pkg-config --cflags --libs roscpp`.
#pragma once

#include <ros/ros.h>

#include <ros/callback_queue.h>
#include <ros/service_callback_helper.h>
#include <ros/service_client.h>
#include <ros/spinner.h>

#include <condition_variable>
#include <cstring>
#include <deque>
#include <future>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include <firm/services.hpp>

namespace firm {

// Return the bytes, after `before`, in the form that roscpp sends: their number first.
inline ros::SerializedMessage counted_bytes(const void* data, std::size_t size, std::optional<std::uint8_t> before) {
  constexpr std::size_t kCount = 4;
  const std::size_t front = before ? 1 : 0;
  ros::SerializedMessage made;
  made.num_bytes = front + kCount + size;
  made.buf.reset(new std::uint8_t[made.num_bytes]);
  made.message_start = made.buf.get() + front + kCount;
  if (before) made.buf[0] = *before;
  for (std::size_t index = 0; index < kCount; ++index) {
    made.buf[front + index] = static_cast<std::uint8_t>(size >> (8 * index));
  }
  if (size > 0) std::memcpy(made.message_start, data, size);
  return made;
}

// The handler that roscpp calls for a request. It waits for the answer, which contains the reason for a failure.
class RawServiceCallback : public ros::ServiceCallbackHelper {
 public:
  explicit RawServiceCallback(CallHandler handler) : handler_(std::move(handler)) {}

  bool call(ros::ServiceCallbackHelperCallParams& params) override {
    const auto* begin = params.request.message_start;
    const std::size_t size = params.request.num_bytes - (begin - params.request.buf.get());
    std::promise<Answer> promise;
    handler_(Bytes(begin, begin + size), [&promise](const Answer& answer) { promise.set_value(answer); });
    const Answer answer = promise.get_future().get();
    constexpr std::uint8_t kFailed = 0, kDone = 1;
    params.response = answer.payload ? counted_bytes(answer.payload->data(), answer.payload->size(), kDone)
                                     : counted_bytes(answer.reason.data(), answer.reason.size(), kFailed);
    return true;
  }

 private:
  CallHandler handler_;
};

// A server with its own queue and thread, since roscpp answers a request when its callback returns.
class RawServer {
 public:
  RawServer(ros::NodeHandle& node, const Service& service, CallHandler handler) : spinner_(1, &callbacks_) {
    ros::AdvertiseServiceOptions options;
    options.service = service.name;
    options.md5sum = service.signature;
    options.datatype = service.type;
    options.req_datatype = service.request_type;
    options.res_datatype = service.response_type;
    options.helper = boost::make_shared<RawServiceCallback>(std::move(handler));
    options.callback_queue = &callbacks_;
    server_ = node.advertiseService(options);
    spinner_.start();
  }

  ~RawServer() {
    spinner_.stop();
    server_.shutdown();
  }

  RawServer(const RawServer&) = delete;
  RawServer& operator=(const RawServer&) = delete;

 private:
  ros::CallbackQueue callbacks_;
  ros::AsyncSpinner spinner_;
  ros::ServiceServer server_;
};

// A client with its own thread, which a server that does not answer may block until ROS ends.
class RawClient {
 public:
  RawClient(ros::NodeHandle& node, const Service& service)
      : signature_(service.signature),
        limit_(service.limit),
        client_(node.serviceClient(*options_of(service))),
        thread_([this] { run(); }) {}

  ~RawClient() {
    stop();
    thread_.join();
  }

  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  // Stop giving answers; the thread may still wait for a server.
  void stop() {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_over_ = true;
    changed_.notify_all();
  }

  void put(Bytes payload, AnswerHandler answer) {
    const std::lock_guard<std::mutex> lock(mutex_);
    waiting_.push_back({std::chrono::steady_clock::now(), std::move(payload), std::move(answer)});
    changed_.notify_all();
  }

 private:
  struct Waiting {
    std::chrono::steady_clock::time_point since;
    Bytes payload;
    AnswerHandler answer;
  };

  // roscpp takes the options by reference.
  static std::shared_ptr<ros::ServiceClientOptions> options_of(const Service& service) {
    return std::make_shared<ros::ServiceClientOptions>(service.name, service.signature, false, ros::M_string());
  }

  void run() {
    while (const auto call = next()) {
      // The line no longer waits for it.
      if (std::chrono::steady_clock::now() - call->since > limit_) continue;
      ros::SerializedMessage response;
      const bool is_done =
          client_.call(counted_bytes(call->payload.data(), call->payload.size(), std::nullopt), response, signature_);
      const std::lock_guard<std::mutex> lock(mutex_);
      if (is_over_) return;
      if (is_done) {
        const auto* begin = response.message_start;
        call->answer({Bytes(begin, begin + response.num_bytes - (begin - response.buf.get()))});
      } else {
        call->answer({std::nullopt, "there is no server, or it reported an error"});
      }
    }
  }

  std::optional<Waiting> next() {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [this] { return is_over_ || !waiting_.empty(); });
    if (is_over_) return std::nullopt;
    std::optional<Waiting> call(std::move(waiting_.front()));
    waiting_.pop_front();
    return call;
  }

  const std::string signature_;
  const std::chrono::nanoseconds limit_;
  ros::ServiceClient client_;
  std::mutex mutex_;  // protects the members below
  std::condition_variable changed_;
  std::deque<Waiting> waiting_;
  bool is_over_ = false;
  std::thread thread_;  // the last member, as it uses the others
};

}  // namespace firm
