// SPDX-License-Identifier: Apache-2.0
// Reads the status over a transport by its address. `send HEX` sends a frame, `rest` waits until the hardware has
// processed all of them and counts the responses by their ids, `status` prints each word that is not zero, `digest HEX` compares the digest.
#include <iostream>
#include <map>
#include <sstream>
#include <string>

#include <firm/open_transport.hpp>
#include <firm/status.hpp>

static firm::Bytes from_hex(const std::string& text) {
  firm::Bytes bytes;
  for (std::size_t place = 0; place + 1 < text.size(); place += 2) {
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(text.substr(place, 2), nullptr, 16)));
  }
  return bytes;
}

static void rest(firm::Transport& transport) {
  std::map<unsigned, unsigned> received, aborted;
  const auto take = [&](const std::optional<firm::Burst>& burst) {
    if (burst) ++received[burst->data[0]];
    if (burst && burst->is_aborted) ++aborted[burst->data[0]];
    return burst.has_value();
  };
  while (!transport.is_at_rest().value_or(false)) take(transport.receive(std::chrono::milliseconds(10)));
  while (take(transport.receive(std::chrono::nanoseconds(0)))) {
  }
  for (const auto& [id, count] : received) std::cout << "received " << id << " " << count << "\n";
  for (const auto& [id, count] : aborted) std::cout << "aborted " << id << " " << count << "\n";
}

static void show(const std::string& name, std::uint32_t word) {
  if (word > 0) std::cout << name << " " << word << "\n";
}

static void show(const firm::Status& status) {
  show("id_errors", status.id_errors);
  show("link_errors", status.link_errors);
  show("lost", status.lost);
  show("last_fault", status.last_channel << 4 | status.last_fault);
  std::cout << "digest " << status.digest << "\n";
  for (unsigned channel = 0; channel < status.channels.size(); ++channel) {
    const bool is_subscriber = channel < status.subscribers;
    const std::string name = (is_subscriber ? "subscriber[" : "publisher[") +
                             std::to_string(is_subscriber ? channel : channel - status.subscribers) + "].";
    const firm::ChannelStatus& counted = status.channels[channel];
    show(name + "frames", counted.frames);
    for (std::size_t code = 1; code <= firm::kFaultCodes; ++code) {
      show(name + "faults[" + std::to_string(code - 1) + "]", counted.faults[code]);
    }
  }
}

int main(int, char** arguments) {
  const auto transport = firm::open_transport(arguments[1]);
  std::string line, command, text;
  while (std::getline(std::cin, line)) {
    std::istringstream words(line);
    words >> command >> text;
    if (command == "send") {
      const firm::Bytes frame = from_hex(text);
      transport->send(frame.data(), frame.size());
    } else if (command == "rest") {
      rest(*transport);
    } else if (command == "status") {
      show(firm::read_status(*transport));
    } else {
      try {
        firm::check_digest(*transport, text, "robot");
        std::cout << "accepted\n";
      } catch (const firm::TransportError& error) {
        std::cout << error.what() << "\n";
      }
    }
  }
}
