// SPDX-License-Identifier: Apache-2.0
// The node at a TAP device; its milliseconds are those of the wall clock. It prints `{"ready": true}` when the
// device is up, then each frame to the host, `{"frame": "hexadecimal", "cycles": number}`, with the cycles from the last
// byte at the GMII to the first beat, and `{"peers": number, "sources": number, "sinks": number}` at each change. The host
// stalls at random. It sends a number to the first topic every 100 ms, or with the argument `echo` what comes. With a
// second argument, so many of 100 frames are lost each way. The program ends with its standard input.
#include <chrono>
#include <deque>
#include <random>
#include <string>

#include "Vnet_node.h"
#include "tap.h"

// Cycles without a byte in either direction, after which nothing happens before a frame or a millisecond comes.
static const uint64_t QUIET = 600;
static const uint64_t PERIOD = 100;

static uint64_t now() {
  using std::chrono::duration_cast;
  return duration_cast<std::chrono::milliseconds>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// A beat of a frame to the host, which the next step moves.
static void take(const Vnet_node& top, std::string& frame, uint64_t cycles) {
  char byte[3];
  std::snprintf(byte, sizeof byte, "%02x", top.m_axis_tdata);
  frame += byte;
  if (!top.m_axis_tlast) return;
  std::printf("{\"frame\": \"%s\", \"cycles\": %llu}\n", frame.c_str(), static_cast<unsigned long long>(cycles));
  std::fflush(stdout);
}

// Frames that the host sends.
class Host {
 public:
  void send(const std::string& bytes) {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    ends_.push_back(bytes.size());
  }
  // The head of a frame, and little-endian XCDR 1.
  void count() {
    std::string frame{0, 8, 0, 0, 0, 0, 1, 0, 0};
    for (int place = 0; place < 4; ++place) frame += static_cast<char>(number_ >> 8 * place);
    ++number_;
    send(frame);
  }
  void show(Vnet_node& top) {
    if (top.s_axis_tvalid && was_ready_) next();
    top.s_axis_tvalid = !bytes_.empty();
    if (bytes_.empty()) return;
    top.s_axis_tdata = static_cast<uint8_t>(bytes_.front());
    top.s_axis_tlast = ends_.front() == 1;
    top.eval();
    was_ready_ = top.s_axis_tready;
  }

 private:
  void next() {
    bytes_.pop_front();
    if (--ends_.front() == 0) ends_.pop_front();
  }

  std::deque<char> bytes_;
  std::deque<std::size_t> ends_;
  uint32_t number_ = 0;
  bool was_ready_ = false;
};

int main(int count, char** arguments) {
  const bool is_echo = count > 1 && std::string(arguments[1]) == "echo";
  Tap tap;
  if (count > 2) tap.lose(std::atoi(arguments[2]));
  Board<Vnet_node> board;
  std::puts("{\"ready\": true}");
  std::fflush(stdout);
  std::mt19937 random(20261126);
  std::string frame, bytes;
  Host host;
  bool is_inside = false;
  int peers = 0, sources = 0, sinks = 0;
  uint64_t wait = PERIOD;
  uint64_t last_byte = 0, latency = 0;
  uint64_t ticked = now();
  while (tap.wait(1)) {
    for (uint64_t quiet = 0; quiet < QUIET; ++quiet) {
      const uint64_t time = now();
      Vnet_node& top = board.top();
      top.tick = ticked < time;
      if (top.tick) {
        ++ticked;
        if (!is_echo && --wait == 0) {
          wait = PERIOD;
          host.count();
        }
      }
      host.show(top);
      if (top.s_axis_tvalid) quiet = 0;
      top.m_axis_tready = random() % 4 != 0;
      if (top.m_axis_tvalid) {
        quiet = 0;
        if (!is_inside) latency = cycle - last_byte;
        is_inside = !(top.m_axis_tready && top.m_axis_tlast);
        if (top.m_axis_tready) {
          take(top, frame, latency);
          bytes += static_cast<char>(top.m_axis_tdata);
          if (top.m_axis_tlast) {
            if (is_echo) host.send(bytes);
            bytes.clear();
            frame.clear();
          }
        }
      }
      if (board.step(tap)) quiet = 0;
      if (top.rx_dv) last_byte = cycle;
      if (peers != top.peer_count || sources != top.source_count || sinks != top.sink_count) {
        peers = top.peer_count;
        sources = top.source_count;
        sinks = top.sink_count;
        std::printf("{\"peers\": %d, \"sources\": %d, \"sinks\": %d}\n", peers, sources, sinks);
        std::fflush(stdout);
      }
    }
  }
}
