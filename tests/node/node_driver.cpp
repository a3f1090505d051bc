// Speaks for firm/node.hpp, with a transport by its address: ADDRESS WIDTH SUBSCRIBERS PUBLISHERS DEPTH OVERFLOW RESTARTS
// DRAIN_MS [TRACE [NAME]]. With NAME, the hardware has a status, which is served with it. A line for each `put SUBSCRIBER HEX`, and for `await COUNT`, which waits until so many payloads were
// published; the end of the input stops the node. It writes a line for each payload that comes back, then what the node
// has to say in the end.
#include <firm/node.hpp>
#include <firm/status_server.hpp>

#include <fstream>
#include <iostream>
#include <sstream>

static constexpr char kDigits[] = "0123456789abcdef";

static firm::Bytes from_hex(const std::string& text) {
  firm::Bytes bytes(text.size() / 2);
  const auto value = [](char digit) { return digit <= '9' ? digit - '0' : digit - 'a' + 10; };
  for (std::size_t place = 0; place < bytes.size(); ++place) {
    bytes[place] = static_cast<std::uint8_t>(value(text[2 * place]) << 4 | value(text[2 * place + 1]));
  }
  return bytes;
}

static std::string to_hex(const std::uint8_t* bytes, std::size_t size) {
  std::string text;
  text.reserve(2 * size);
  for (std::size_t place = 0; place < size; ++place) {
    text += kDigits[bytes[place] >> 4];
    text += kDigits[bytes[place] & 15];
  }
  return text;
}

static std::atomic<int> breaks{0};

// As the node does it, but breaks are counted: a pseudo-terminal has none.
static std::unique_ptr<firm::Transport> open(const std::string& address, const firm::TransportOptions& options) {
  if (address.rfind("uart:/dev/pts/", 0) != 0) return firm::open_transport(address, options);
  const auto parts = firm::TransportAddress::of(address);
  firm::UartOptions uart;
  uart.baud = parts.number();
  uart.has_flow_control = parts.has_option;
  uart.send_break = [](int) { return ++breaks, 0; };
  return std::make_unique<firm::UartTransport>(parts.first, options, uart);
}

static void feed(firm::Node& node) {
  std::string line, command;
  while (std::getline(std::cin, line)) {
    std::istringstream words(line);
    words >> command;
    if (command == "put") {
      unsigned subscriber;
      std::string text;
      words >> subscriber >> text;
      const firm::Bytes payload = from_hex(text);
      try {
        node.put(subscriber, payload.data(), payload.size());
      } catch (const std::logic_error& error) {
        std::cout << "refused " << error.what() << "\n";
      }
    } else {
      std::uint64_t count;
      words >> count;
      const firm::Deadline deadline(std::chrono::seconds(20));
      while (node.statistics().published < count && node.error().empty() && !deadline.is_over()) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
    }
  }
}

int main(int, char** arguments) {
  firm::NodeConfiguration configuration;
  configuration.width = static_cast<unsigned>(std::stoul(arguments[2]));
  configuration.subscribers = static_cast<unsigned>(std::stoul(arguments[3]));
  configuration.publishers = static_cast<unsigned>(std::stoul(arguments[4]));
  configuration.queue_depth = std::stoul(arguments[5]);
  const std::string overflow = arguments[6];
  configuration.overflow = overflow == "block"         ? firm::Overflow::kBlock
                           : overflow == "drop_newest" ? firm::Overflow::kDropNewest
                                                       : firm::Overflow::kDropOldest;
  configuration.restarts = static_cast<unsigned>(std::stoul(arguments[7]));
  configuration.restart_delay = std::chrono::milliseconds(10);
  configuration.longest_payload = 10'000'000;
  const std::chrono::milliseconds drain(std::stoul(arguments[8]));
  std::ofstream trace;
  const std::string trace_path = arguments[9] ? arguments[9] : "";
  if (!trace_path.empty()) {
    trace.open(trace_path);
    configuration.trace = &trace;
  }
  const std::string served = arguments[9] && arguments[10] ? arguments[10] : "";
  configuration.has_status = !served.empty();
  std::ostringstream log;
  const auto report = [&](const std::string& line) { log << line << "\n"; };
  configuration.log = [&](firm::Level, const std::string& line) { report(line); };
  std::ostringstream published;
  const auto publish = [&](unsigned publisher, const std::uint8_t* payload, std::size_t size) {
    published << "published " << publisher << " " << to_hex(payload, size) << "\n";
    if (std::string(payload, payload + size) == "slow") std::this_thread::sleep_for(std::chrono::milliseconds(300));
  };
  const std::string address = arguments[1];
  firm::Node node(
      configuration, [&](const firm::TransportOptions& options) { return open(address, options); }, publish);
  std::optional<firm::StatusServer> server;
  if (!served.empty()) {
    const auto access = [&](const firm::Bytes& request) { return node.access_status(request, std::chrono::seconds(2)); };
    server.emplace(std::vector<std::string>{served}, access, report,
                   std::vector<firm::Parameter>{{"block.gain", "int32", -3, -2147483648.0, 2147483647},
                                                {"block.offset", "float32", 0.5, -1.5, 1e30},
                                                {"other.invert", "bool", 1, 0, 1}});
    std::cout << "serves" << std::endl;
  }
  int status = -1;
  std::thread engine([&] { status = node.run(); });
  feed(node);
  node.stop(drain);
  engine.join();
  const auto counts = node.statistics();
  std::cout << published.str() << "received " << counts.received << "\ndropped " << counts.dropped << "\nsent "
            << counts.sent << "\nerrors " << counts.errors << "\nrestarts " << counts.restarts << "\nbreaks " << breaks << "\nstatus " << status
            << "\nerror " << node.error() << "\n";
  std::istringstream lines(log.str());
  for (std::string line; std::getline(lines, line);) std::cout << "log " << line << "\n";
}
