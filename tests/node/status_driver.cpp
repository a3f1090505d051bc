// SPDX-License-Identifier: Apache-2.0
// Reads the status. The transport is standard output and input: a frame is a line of hexadecimal digits. Each word that
// is not zero is printed, after '='. The arguments are the bytes of an id, and the digest.
#include <iostream>
#include <string>

#include <firm/status.hpp>

namespace {

class LineTransport : public firm::Transport {
 public:
  void send(const std::uint8_t* frame, std::size_t size) override {
    constexpr char kDigits[] = "0123456789abcdef";
    for (std::size_t place = 0; place < size; ++place) {
      std::cout << kDigits[frame[place] >> 4] << kDigits[frame[place] & 15];
    }
    std::cout << std::endl;
  }

  std::optional<firm::Burst> receive(firm::Timeout) override {
    std::string line;
    if (!std::getline(std::cin, line)) return std::nullopt;
    firm::Burst burst;
    for (std::size_t place = 0; place + 1 < line.size(); place += 2) {
      burst.data.push_back(static_cast<std::uint8_t>(std::stoul(line.substr(place, 2), nullptr, 16)));
    }
    return burst;
  }

  void close() override {}
};

void show(const std::string& name, std::uint32_t word) {
  if (word > 0) std::cout << "= " << name << " " << word << "\n";
}

void show(const firm::Status& status) {
  show("control", status.is_counting);
  show("interrupt", status.interrupts);
  show("interrupt_enable", status.enabled_interrupts);
  show("id_errors", status.id_errors);
  show("link_errors", status.link_errors);
  show("lost", status.lost);
  show("last_fault", status.last_channel << 4 | status.last_fault);
  show("cycles", status.cycles);
  std::cout << "= digest " << status.digest << "\n";
  for (unsigned channel = 0; channel < status.channels.size(); ++channel) {
    const bool is_subscriber = channel < status.subscribers;
    const std::string name = (is_subscriber ? "subscriber[" : "publisher[") +
                             std::to_string(is_subscriber ? channel : channel - status.subscribers) + "].";
    const firm::ChannelStatus& counted = status.channels[channel];
    show(name + "frames", counted.frames);
    show(name + "longest_wait", counted.longest_wait);
    show(name + "stamp", counted.stamp);
    for (std::size_t code = 1; code <= firm::kFaultCodes; ++code) {
      show(name + "faults[" + std::to_string(code - 1) + "]", counted.faults[code]);
    }
  }
}

bool accepts(firm::Transport& transport, std::size_t id_bytes, const std::string& digest) {
  try {
    firm::StatusAccess access(transport, std::chrono::seconds(20), id_bytes);
    firm::check_digest(access, digest, "robot");
    return true;
  } catch (const firm::TransportError&) {
    return false;
  }
}

}  // namespace

int main(int, char** arguments) {
  LineTransport transport;
  const std::size_t id_bytes = std::stoul(arguments[1]);
  show(firm::read_status(transport, id_bytes));
  return accepts(transport, id_bytes, arguments[2]) && !accepts(transport, id_bytes, "00") ? 0 : 1;
}
