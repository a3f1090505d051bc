// SPDX-License-Identifier: Apache-2.0
// Parameters in C++: each line is a type, default, least and most value, the text of a value, and how many accesses the
// hardware answers. It prints the word in effect, the value that the node then has, and the reason of a refusal.
#include <cstdint>
#include <iostream>
#include <sstream>
#include <string>
#include <variant>

#include <firm/parameters.hpp>

int main() {
  for (std::string line; std::getline(std::cin, line);) {
    std::istringstream words(line);
    firm::Parameter parameter{"block.value", "", 0, 0, 0};
    std::string text;
    int left = 0;
    words >> parameter.type >> parameter.initial >> parameter.least >> parameter.most >> text >> left;
    firm::HardwareParameters parameters({parameter}, {});
    std::uint32_t wanted = parameter.word(parameter.value(parameter.initial)), word = wanted;
    const auto access = [&](const firm::Bytes& request) {
      if (left-- <= 0) throw firm::TransportError("no answer");
      const std::uint32_t address = *firm::status_address(request);
      const std::uint32_t before = (address & ~firm::kStatusWrite) == 0x100 ? wanted : word;
      if (address & firm::kStatusWrite) wanted = word = firm::status_word(request);
      return before;
    };
    std::string reason;
    try {
      reason = parameters.set({{"block.value", parameter.value(text)}}, access);
    } catch (const std::invalid_argument& fault) {
      reason = fault.what();
    }
    std::cout.precision(17);
    std::cout << word << " ";
    std::visit([](auto value) { std::cout << value; }, parameters.values().at("block.value"));
    std::cout << " " << reason << std::endl;
  }
}
