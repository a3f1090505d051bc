// Speaks for firm/content.hpp. Each line of input, `NUMBERS / PAYLOAD`, both of them words, and the payload's bytes in
// hexadecimal, gives a line with the size of the payload without the bytes after its message.
#include <firm/content.hpp>

#include <iostream>
#include <sstream>
#include <string>

int main() {
  std::string line;
  while (std::getline(std::cin, line)) {
    std::istringstream words(line);
    firm::Content content;
    std::string word;
    while (words >> word && word != "/") content.push_back(std::stoll(word));
    word.clear();
    words >> word;
    std::vector<std::uint8_t> payload;
    for (std::size_t place = 0; place < word.size(); place += 2) {
      payload.push_back(static_cast<std::uint8_t>(std::stoul(word.substr(place, 2), nullptr, 16)));
    }
    std::cout << firm::content_size(content, payload.data(), payload.size()) << "\n" << std::flush;
  }
}
