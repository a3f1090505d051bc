// SPDX-License-Identifier: Apache-2.0
// A generated node without ROS: one topic each way, and a status with AXI4-Lite. The first argument is its name.
#include <firm/ros_node.hpp>

namespace {

// A middleware that nobody else uses.
class Alone {
 public:
  static constexpr unsigned kVersion = 1;
  static constexpr bool kCountsDrops = true;
  static constexpr std::size_t kUnlimited = 0;
  static constexpr bool kTellsFailures = true;
  static constexpr const char* kArguments = "";

  Alone(int&, char**, const std::string&) {}

  bool start(const std::function<bool()>&) { return true; }
  std::map<std::string, std::string> parameters(const std::vector<std::string>&) const {
    return {{"overflow", "drop_newest"}, {"restart", "false"}};
  }
  void subscribe(const firm::Topic&, const firm::Quality&, firm::MessageHandler) {}
  firm::MessageHandler advertise(const firm::Topic& topic, const firm::Quality&) {
    return [name = topic.name](const std::uint8_t* data, std::size_t size) {
      std::cout << name << " " << std::string(data, data + size) << std::endl;
    };
  }
  void offer(firm::HardwareParameters&, firm::SetParameters) {}
  void serve(const firm::Service&, firm::CallHandler) {}
  firm::CallHandler caller(const firm::Service&) { return nullptr; }
  void stop_calls() {}
  void spin_during(const std::function<void()>& drain) { drain(); }
  bool spin(std::chrono::milliseconds duration) {
    std::this_thread::sleep_for(duration);
    return true;
  }
  std::uint64_t lost() const { return 0; }
  void unsubscribe() {}
  void flush() {}
  bool has_publisher(const firm::Topic&) const { return true; }
  bool has_subscriber(const firm::Topic&) const { return true; }
};

}  // namespace

int main(int argc, char** argv) {
  const firm::System system{argv[1], 8, 1, 1, 100, "00000003000000020000000100000000", true,
                            {{0, "in", "", ""}}, {{0, "out", "", ""}}, {{}, "/diagnostics", "", ""}, {"left", "right"}};
  return firm::run<Alone>(system, argc - 1, argv + 1);
}
