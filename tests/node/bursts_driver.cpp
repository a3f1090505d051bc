// Speaks for firm/bursts.hpp: `joiner PUBLISHERS WIDTH LONGEST`, then a line for each `push TID HEX` (TID may be `-`),
// `abort TID HEX` and `close`; each line of input gives one of output.
#include <firm/bursts.hpp>

#include <cstdio>
#include <iostream>
#include <sstream>

static std::vector<std::uint8_t> from_hex(const std::string& text) {
  std::vector<std::uint8_t> bytes;
  for (std::size_t place = 0; place + 1 < text.size(); place += 2) {
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(text.substr(place, 2), nullptr, 16)));
  }
  return bytes;
}

static std::string answer(firm::BurstJoiner& joiner, std::istringstream& words, const std::string& command) {
  if (command == "close") {
    joiner.close();
    return "closed";
  }
  std::string tid, burst;
  words >> tid >> burst;
  const auto frame = joiner.push(
      from_hex(burst), tid == "-" ? std::nullopt : std::optional<unsigned>(std::stoul(tid)), command == "abort");
  std::ostringstream text;
  if (frame) {
    text << "frame " << unsigned{frame->id} << " ";
    char digits[3];
    for (const auto byte : frame->payload) {
      std::snprintf(digits, sizeof digits, "%02x", byte);
      text << digits;
    }
    return text.str();
  }
  text << "unfinished";
  for (const auto id : joiner.unfinished()) text << " " << unsigned{id};
  return text.str();
}

int main() {
  std::optional<firm::BurstJoiner> joiner;
  std::string line, command;
  while (std::getline(std::cin, line)) {
    std::istringstream words(line);
    words >> command;
    try {
      if (command == "joiner") {
        unsigned publishers, width;
        std::size_t longest;
        words >> publishers >> width >> longest;
        joiner.emplace(publishers, width, longest);
        std::cout << "ready\n";
      } else {
        std::cout << answer(*joiner, words, command) << "\n";
      }
    } catch (const std::exception& error) {
      std::cout << "error: " << error.what() << "\n";
    }
  }
}
