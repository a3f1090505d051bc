// SPDX-License-Identifier: Apache-2.0
// The parameter services of a node of ROS 2 without ROS: each line is a service and a request in hexadecimal digits. It
// prints the events that are published, the lines of the log, and the response.
#include <cstdint>
#include <cstdio>
#include <iostream>
#include <map>
#include <string>
#include <utility>

#include <firm/ros2_parameters.hpp>

namespace {

void print(const std::string& what, const std::uint8_t* data, std::size_t size) {
  std::cout << what << " ";
  for (std::size_t index = 0; index < size; ++index) {
    char digits[3];
    std::snprintf(digits, sizeof digits, "%02x", data[index]);
    std::cout << digits;
  }
  std::cout << std::endl;
}

firm::Bytes bytes_of(const std::string& digits) {
  firm::Bytes found;
  for (std::size_t place = 0; place < digits.size(); place += 2) {
    found.push_back(static_cast<std::uint8_t>(std::stoul(digits.substr(place, 2), nullptr, 16)));
  }
  return found;
}

}  // namespace

int main() {
  std::cerr.rdbuf(std::cout.rdbuf());
  firm::HardwareParameters parameters({{"block.gain", "int16", 3, -4, 100},
                                       {"block.offset", "float32", 0.5, -1.5, 10},
                                       {"block.invert", "bool", 0, 0, 1}},
                                      {});
  std::map<std::uint32_t, std::uint32_t> words;
  const auto access = [&](const firm::Bytes& request) {
    const std::uint32_t address = *firm::status_address(request), place = address & ~firm::kStatusWrite;
    // A written word is in effect at once.
    if (address & firm::kStatusWrite) words[place] = words[place + 4] = firm::status_word(request);
    return words[place];
  };
  firm::ParameterServices services(parameters, [&](const auto& values) { return parameters.set(values, access); });
  std::map<std::string, firm::CallHandler> served;
  services.open(
      "/arm/node",
      [&](const firm::Service& service, firm::CallHandler handler) { served[service.name] = std::move(handler); },
      [](const std::uint8_t* data, std::size_t size) { print("event", data, size); });
  for (std::string name, request; std::cin >> name >> request;) {
    served.at("/arm/node/" + name)(bytes_of(request), [](const firm::Answer& answer) {
      print("response", answer.payload->data(), answer.payload->size());
    });
  }
}
