// Speaks for firm/action_client.hpp: VERSION LIMIT_MS. A line for each command, with what the client then does:
//
//     goal HEX, cancel HEX, forget, give_up, tick                    from the hardware and the node
//     states HEX, result HEX, answer NUMBER HEX                      from the server; NUMBER is that of a call
//     feedback HEX                                                   the same (ROS 2), without the encoding and the id of
//                                                                    the last call's goal
//     await TEXT COUNT                                               waits for so many lines that begin with TEXT
//     canceled MS                                                    waits for the answer to a goal; prints when it ends
//     fault                                                          lets the next message to the server fail
//
// Each event is a line: `put SUBSCRIBER HEX`, `publish TOPIC HEX`, `call SERVICE NUMBER HEX`, `fault TEXT`.
#include <firm/action_client.hpp>

#include <atomic>
#include <iostream>
#include <sstream>
#include <thread>

namespace {

firm::Bytes from_hex(const std::string& text) {
  firm::Bytes bytes;
  for (std::size_t place = 0; place + 1 < text.size(); place += 2) {
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(text.substr(place, 2), nullptr, 16)));
  }
  return bytes;
}

std::string to_hex(const firm::Bytes& bytes) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const unsigned byte : bytes) text += {kDigits[byte >> 4], kDigits[byte & 15]};
  return text;
}

// The events, which any thread adds.
class Events {
 public:
  void add(const std::string& line) {
    const std::lock_guard<std::mutex> lock(mutex_);
    lines_.push_back(line);
    std::cout << line << std::endl;
  }

  void await(const std::string& begin, std::size_t count) const {
    while (found(begin) < count) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }

  // Return the encoding and the id in the last call.
  std::string last_id() const {
    constexpr std::size_t kDigits = 40;
    const std::lock_guard<std::mutex> lock(mutex_);
    const std::string& line = lines_.back();
    return line.substr(line.rfind(' ') + 1, kDigits);
  }

 private:
  std::size_t found(const std::string& begin) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    std::size_t count = 0;
    for (const auto& line : lines_) count += line.rfind(begin, 0) == 0;
    return count;
  }

  mutable std::mutex mutex_;
  std::vector<std::string> lines_;
};

}  // namespace

int main(int, char** arguments) {
  // Reports to the user; sanitizers have their own.
  std::cerr.rdbuf(nullptr);
  const bool is_first = arguments[1] == std::string("1");
  firm::Action action{};
  action.block = action.name = "count";
  action.limit = std::chrono::milliseconds(std::stoul(arguments[2]));
  action.feedback = 1;
  action.result = 2;
  action.no_result = is_first ? firm::Bytes(33) : firm::Bytes{0, 1, 0, 0, 0, 0, 0, 0};
  Events events;
  std::mutex mutex;
  std::vector<firm::AnswerHandler> handlers;
  std::atomic<bool> fails{false};
  firm::ActionClient client(
      action, is_first,
      [&](unsigned subscriber, const std::uint8_t* payload, std::size_t size) {
        events.add("put " + std::to_string(subscriber) + " " + to_hex(firm::Bytes(payload, payload + size)));
        return true;
      },
      [&](const std::string& reason) { events.add("fault " + reason); });
  std::vector<firm::PublishBytes> publishers;
  std::vector<firm::CallHandler> services;
  for (const char* topic : {"0", "1"}) {
    publishers.push_back([&, topic](const firm::Bytes& payload) {
      events.add(std::string("publish ") + topic + " " + to_hex(payload));
    });
  }
  for (const char* service : {"0", "1", "2"}) {
    services.push_back([&, service](const firm::Bytes& payload, firm::AnswerHandler handler) {
      if (fails) throw std::runtime_error("the middleware is broken");
      std::size_t number = 0;
      {
        const std::lock_guard<std::mutex> lock(mutex);
        number = handlers.size();
        handlers.push_back(std::move(handler));
      }
      events.add(std::string("call ") + service + " " + std::to_string(number) + " " + to_hex(payload));
    });
  }
  client.start(std::move(publishers), is_first ? std::vector<firm::CallHandler>{} : std::move(services));
  std::thread ending;
  std::string line;
  while (std::getline(std::cin, line)) {
    std::istringstream words(line);
    std::string command, text;
    std::size_t number = 0;
    words >> command;
    if (command == "answer" || command == "canceled") words >> number;
    if (command == "await") std::getline(words >> std::ws, text, ',');
    words >> (command == "await" ? command : text);
    if (line.rfind("await", 0) == 0) {
      events.await(text, std::stoul(command));
    } else if (command == "goal") {
      client.take_goal(from_hex(text));
    } else if (command == "cancel") {
      client.take_cancel(from_hex(text));
    } else if (command == "forget") {
      client.forget();
    } else if (command == "give_up") {
      client.give_up();
    } else if (command == "tick") {
      client.tick();
    } else if (command == "states") {
      client.take_states(from_hex(text));
    } else if (command == "feedback") {
      client.take_feedback(from_hex(events.last_id() + text));
    } else if (command == "result") {
      client.take_result(from_hex(text));
    } else if (command == "fault") {
      fails = true;
    } else if (command == "canceled") {
      const auto latest = std::chrono::steady_clock::now() + std::chrono::milliseconds(number);
      ending = std::thread([&client, &events, latest] {
        client.wait_until_canceled(latest);
        events.add("canceled");
      });
    } else {
      firm::AnswerHandler handler;
      {
        const std::lock_guard<std::mutex> lock(mutex);
        handler = handlers.at(number);
      }
      handler({from_hex(text)});
    }
  }
  if (ending.joinable()) ending.join();
  client.close();
}
