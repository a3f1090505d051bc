// The node of firm/ros_node.hpp with a middleware of its own, which hands over one message or one call, and fails where
// asked:
//
//     FAULT=none|stay|publish|call|answer|connect|spin ros_node_driver OPTION ...
//
// With `stay`, the middleware does not end the node after the message has come back. Publisher 0 of the hardware has a topic, or for the faults `call` and `connect` the requests to a service; for
// `answer`, it has the responses of one. The hardware sends back what it receives.
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <map>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <firm/ros_node.hpp>

namespace {

std::string fault() { return std::getenv("FAULT"); }

[[noreturn]] void fail() { throw std::runtime_error("the middleware is broken"); }

class Middleware {
 public:
  static constexpr unsigned kVersion = 1;
  static constexpr bool kCountsDrops = false;
  static constexpr std::size_t kUnlimited = 0;
  static constexpr const char* kArguments = "";

  Middleware(int&, char**, const std::string&) {}
  // The threads of the node must not use it any more.
  ~Middleware() { std::cerr << (are_calls_stopped_ ? "the calls are stopped" : "the calls go on") << std::endl; }
  Middleware(const Middleware&) = delete;
  Middleware& operator=(const Middleware&) = delete;

  template <typename IsStopped>
  bool start(IsStopped) {
    return true;
  }
  std::map<std::string, std::string> parameters(const std::vector<std::string>&) const { return {}; }

  void subscribe(const firm::Topic&, const firm::Quality&, firm::MessageHandler handler) {
    give_ = [handler = std::move(handler)] {
      const firm::Bytes payload(8, 7);
      handler(payload.data(), payload.size());
    };
  }

  firm::MessageHandler advertise(const firm::Topic& topic, const firm::Quality&) {
    if (topic.name == "/diagnostics") return [](const std::uint8_t*, std::size_t) {};
    return [this](const std::uint8_t*, std::size_t) {
      if (fault() == "publish") fail();
      is_done_ = fault() != "stay";
    };
  }

  void offer(firm::HardwareParameters&, firm::SetParameters) {}
  void serve(const firm::Service&, firm::CallHandler handler) {
    give_ = [handler = std::move(handler)] {
      handler(firm::Bytes(8, 7), [](const firm::Answer&) { fail(); });
    };
  }

  firm::CallHandler caller(const firm::Service&) {
    if (fault() == "connect") fail();
    return [](const firm::Bytes&, const firm::AnswerHandler&) { fail(); };
  }

  bool spin(std::chrono::milliseconds duration) {
    if (fault() == "spin") fail();
    if (give_) std::exchange(give_, nullptr)();
    std::this_thread::sleep_for(duration);
    // The node has to notice a fault by itself.
    if (++spins_ == kMostSpins) std::cerr << "the middleware ends the node" << std::endl;
    return !is_done_ && spins_ < kMostSpins;
  }

  void spin_during(const std::function<void()>& drain) { drain(); }
  void stop_calls() { are_calls_stopped_ = true; }
  std::uint64_t lost() const { return 0; }
  void unsubscribe() {}
  void flush() {}
  bool has_publisher(const firm::Topic&) const { return true; }
  bool has_subscriber(const firm::Topic&) const { return true; }

 private:
  static constexpr unsigned kMostSpins = 1200;  // of 50 ms

  std::function<void()> give_;
  unsigned spins_ = 0;
  std::atomic<bool> is_done_{false};
  bool are_calls_stopped_ = false;
};

firm::System system_with(const std::string& fault) {
  const bool is_served = fault == "answer", is_called = fault == "call" || fault == "connect";
  firm::System system;
  system.name = "driven";
  system.width = 64;
  system.subscriber_count = system.publisher_count = 2;
  system.queue_depth = 10;
  system.has_status_registers = false;
  if (!is_served) system.subscribers = {{0, "/in", "", ""}};
  if (is_served || is_called) {
    system.services = {{"service", is_served, 0, is_served ? 0u : 1u, "/service", "", "", "", "",
                        std::chrono::milliseconds(100000), {}}};
  } else {
    system.publishers = {{0, "/out", "", ""}};
  }
  system.diagnostics = {std::nullopt, "/diagnostics", "", ""};
  return system;
}

}  // namespace

int main(int argc, char** argv) { return firm::run<Middleware>(system_with(fault()), argc, argv); }
