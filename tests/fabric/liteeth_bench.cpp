// SPDX-License-Identifier: Apache-2.0
// Obeys lines: `send PORT HEXADECIMAL` is a payload for the host to send, `run NUMBER` lets so many milliseconds pass.
// After these it prints what came, `frame HEXADECIMAL`, `discovery HEXADECIMAL` or `user HEXADECIMAL`, and `done`.
// A payload from another address than the node's, or of another length than LiteEth tells, ends the program.
#include <cstdint>
#include <cstdio>
#include <deque>
#include <iostream>
#include <string>
#include <vector>

#include "Vliteeth_bench.h"
#include "bench.h"

static const unsigned CYCLES = 1250;  // of a millisecond, so that it lasts as long as at 1.25 MHz
static const uint32_t NODE = 0xc0000209;

struct Datagram {
  unsigned port;
  std::vector<uint8_t> payload;
};

class Lines {
 public:
  explicit Lines(const char* name) : name_(name) {}
  void take(uint8_t byte, bool is_last) {
    char text[3];
    std::snprintf(text, sizeof text, "%02x", byte);
    bytes_ += text;
    if (!is_last) return;
    std::printf("%s %s\n", name_, bytes_.c_str());
    bytes_.clear();
  }
  std::size_t size() const { return bytes_.size() / 2; }

 private:
  const char* name_;
  std::string bytes_;
};

class Bench {
 public:
  Bench() {
    top_.tick = top_.sink_valid = 0;
    reset(top_);
  }
  void send(Datagram datagram) { waiting_.push_back(std::move(datagram)); }
  void run(unsigned milliseconds) {
    for (unsigned cycles = 0; cycles < milliseconds * CYCLES; ++cycles) {
      top_.tick = cycles % CYCLES == 0;
      step();
    }
  }

 private:
  void step() {
    offer();
    top_.clk = 0;
    top_.eval();
    const bool is_taken = top_.sink_valid && top_.sink_ready;
    if (top_.frame_tvalid && top_.frame_tready) frames_.take(top_.frame_tdata, top_.frame_tlast);
    if (top_.discovery_valid) {
      check(top_.discovery_ip_address, discovery_, top_.discovery_last, top_.discovery_length);
      discovery_.take(top_.discovery_data, top_.discovery_last);
    }
    if (top_.user_valid) {
      check(top_.user_ip_address, user_, top_.user_last, top_.user_length);
      user_.take(top_.user_data, top_.user_last);
    }
    top_.clk = 1;
    top_.eval();
    if (!is_taken) return;
    if (++sent_ < waiting_.front().payload.size()) return;
    waiting_.pop_front();
    sent_ = 0;
  }
  void offer() {
    top_.sink_valid = !waiting_.empty();
    if (waiting_.empty()) return;
    const Datagram& next = waiting_.front();
    top_.sink_data = next.payload[sent_];
    top_.sink_last = sent_ + 1 == next.payload.size();
    top_.sink_dst_port = next.port;
    top_.sink_length = next.payload.size();
  }
  static void check(uint32_t address, const Lines& lines, bool is_last, unsigned length) {
    if (address != NODE) fail("a payload of another address");
    if (is_last && lines.size() + 1 != length) fail("a payload of another length");
  }

  Vliteeth_bench top_;
  std::deque<Datagram> waiting_;
  std::size_t sent_ = 0;
  Lines frames_{"frame"}, discovery_{"discovery"}, user_{"user"};
};

int main() {
  Bench bench;
  std::string command;
  while (std::cin >> command) {
    unsigned number;
    std::cin >> number;
    if (command == "send") {
      std::string text;
      std::cin >> text;
      Datagram datagram{number, {}};
      for (std::size_t place = 0; place + 1 < text.size(); place += 2)
        datagram.payload.push_back(static_cast<uint8_t>(std::stoi(text.substr(place, 2), nullptr, 16)));
      bench.send(std::move(datagram));
    } else {
      bench.run(number);
      std::puts("done");
      std::fflush(stdout);
    }
  }
}
