// SPDX-License-Identifier: Apache-2.0
// A board's GMII at the TAP device tap0 of this network namespace: frames of the kernel go to the board with preamble
// and frame check sequence, and those of the board to the kernel without. A frame of the board with a wrong sequence
// ends the program.
#pragma once
#include <fcntl.h>
#include <linux/if.h>
#include <linux/if_tun.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cstring>
#include <deque>
#include <random>

#include "bench.h"

using Bytes = std::vector<uint8_t>;

static const unsigned GAP = 12;
static uint32_t crc_of(const uint8_t* bytes, std::size_t size) {
  uint32_t crc = ~0u;
  for (std::size_t place = 0; place < size; ++place) {
    crc ^= bytes[place];
    for (int bit = 0; bit < 8; ++bit) crc = crc & 1 ? crc >> 1 ^ 0xEDB88320u : crc >> 1;
  }
  return ~crc;
}

class Tap {
 public:
  Tap() : device_(open("/dev/net/tun", O_RDWR | O_NONBLOCK)) {
    ifreq request{};
    request.ifr_flags = IFF_TAP | IFF_NO_PI;
    std::strcpy(request.ifr_name, "tap0");
    if (device_ < 0 || ioctl(device_, TUNSETIFF, &request) < 0) fail("the TAP device cannot be opened");
  }
  ~Tap() { close(device_); }

  // Wait for a frame, for so many milliseconds or without end; false at the end of the standard input.
  bool wait(int milliseconds = -1) const {
    pollfd events[] = {{device_, POLLIN, 0}, {STDIN_FILENO, POLLIN, 0}};
    poll(events, 2, milliseconds);
    return events[1].revents == 0;
  }
  // Lose so many of 100 frames each way, at random.
  void lose(unsigned percent) { loss_ = percent; }
  Bytes read() const {
    uint8_t bytes[2048];
    const ssize_t size = ::read(device_, bytes, sizeof bytes);
    return size > 0 && !is_lost() ? Bytes(bytes, bytes + size) : Bytes();
  }
  void write(const Bytes& frame) const {
    if (!is_lost() && ::write(device_, frame.data(), frame.size()) < 0) fail("the kernel does not take a frame");
  }

 private:
  bool is_lost() const { return loss_ > 0 && random_() % 100 < loss_; }

  int device_;
  unsigned loss_ = 0;
  mutable std::mt19937 random_{20261127};
};

template <class Top>
class Board {
 public:
  Board() {
    top_.rx_dv = 0;
    reset(top_);
  }
  // A cycle; true if a byte moved.
  bool step(const Tap& tap) {
    if (line_.empty()) load(tap.read());
    top_.rx_dv = !line_.empty() && line_.front() >= 0;
    top_.rxd = top_.rx_dv ? static_cast<uint8_t>(line_.front()) : 0;
    const bool is_busy = !line_.empty() || top_.tx_en;
    if (!line_.empty()) line_.pop_front();
    top_.clk = 0;
    top_.eval();
    top_.clk = 1;
    top_.eval();
    ++cycle;
    if (top_.tx_en)
      sent_.push_back(top_.txd);
    else if (!sent_.empty())
      unload(tap);
    return is_busy;
  }

  Top& top() { return top_; }

 private:
  void load(Bytes frame) {
    if (frame.empty()) return;
    if (frame.size() < 60) frame.resize(60);
    const uint32_t crc = crc_of(frame.data(), frame.size());
    line_.insert(line_.end(), 7, 0x55);
    line_.push_back(0xd5);
    line_.insert(line_.end(), frame.begin(), frame.end());
    for (int place = 0; place < 4; ++place) line_.push_back(crc >> 8 * place & 0xff);
    line_.insert(line_.end(), GAP, -1);
  }
  void unload(const Tap& tap) {
    if (sent_.size() < 8 + 64) fail("a short frame");
    const Bytes frame(sent_.begin() + 8, sent_.end() - 4);
    uint32_t sequence = 0;
    for (int place = 0; place < 4; ++place) sequence |= uint32_t(sent_[sent_.size() - 4 + place]) << 8 * place;
    if (sent_[7] != 0xd5 || sequence != crc_of(frame.data(), frame.size())) fail("a wrong frame check sequence");
    tap.write(frame);
    sent_.clear();
  }

  Top top_;
  std::deque<int> line_;  // to the board; -1 is an idle byte
  Bytes sent_;            // by the board
};
