// SPDX-License-Identifier: Apache-2.0
// Frames on a link in C++. Each line is a word and bytes in hexadecimal. `encode` prints a frame as it is sent;
// `decode` gives bytes to the decoder, and prints the frames, and `-` for each that is broken.
#include <cstdio>
#include <iostream>
#include <string>

#include <firm/link_code.hpp>

static void show(const firm::Bytes& bytes) {
  for (const unsigned byte : bytes) std::printf("%02x", byte);
}

static firm::Bytes from_hex(const std::string& text) {
  firm::Bytes bytes;
  for (std::size_t place = 0; place + 1 < text.size(); place += 2) {
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(text.substr(place, 2), nullptr, 16)));
  }
  return bytes;
}

int main() {
  firm::LinkDecoder decoder(70000);
  std::string line;
  while (std::getline(std::cin, line)) {
    const firm::Bytes bytes = from_hex(line.substr(7));
    if (line.rfind("encode", 0) == 0) {
      show(firm::link_encoded(bytes.data(), bytes.size()));
    } else {
      for (const std::uint8_t byte : bytes) {
        const firm::LinkEvent event = decoder.push(byte);
        if (event == firm::LinkEvent::kFrame) {
          show(decoder.pop());
          std::printf(" ");
        } else if (event == firm::LinkEvent::kBroken) {
          std::printf("- ");
        }
      }
    }
    std::printf("\n");
  }
}
