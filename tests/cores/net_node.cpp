// SPDX-License-Identifier: Apache-2.0
// The node at a TAP device; its milliseconds are those of the wall clock. It prints `{"ready": true}` when the
// device is up, then each frame to the host, `{"frame": "hexadecimal", "cycles": number}`, with the cycles from the last
// byte at the GMII to the first beat, and `{"peers": number, "sources": number}` at each change. The host stalls at
// random. The program ends with its standard input.
#include <chrono>
#include <random>

#include "Vnet_node.h"
#include "tap.h"

// Cycles without a byte in either direction, after which nothing happens before a frame or a millisecond comes.
static const uint64_t QUIET = 600;

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
  frame.clear();
}

int main() {
  const Tap tap;
  Board<Vnet_node> board;
  std::puts("{\"ready\": true}");
  std::fflush(stdout);
  std::mt19937 random(20261126);
  std::string frame;
  bool is_inside = false;
  int peers = 0, sources = 0;
  uint64_t last_byte = 0, latency = 0;
  uint64_t ticked = now();
  while (tap.wait(1)) {
    for (uint64_t quiet = 0; quiet < QUIET; ++quiet) {
      const uint64_t time = now();
      board.top().tick = ticked < time;
      ticked += ticked < time;
      Vnet_node& top = board.top();
      top.m_axis_tready = random() % 4 != 0;
      if (top.m_axis_tvalid) {
        quiet = 0;
        if (!is_inside) latency = cycle - last_byte;
        is_inside = !(top.m_axis_tready && top.m_axis_tlast);
        if (top.m_axis_tready) take(top, frame, latency);
      }
      if (board.step(tap)) quiet = 0;
      if (top.rx_dv) last_byte = cycle;
      const int peers_now = __builtin_popcount(top.peers_known), sources_now = __builtin_popcount(top.sources_known);
      if (peers != peers_now || sources != sources_now) {
        peers = peers_now;
        sources = sources_now;
        std::printf("{\"peers\": %d, \"sources\": %d}\n", peers, sources);
        std::fflush(stdout);
      }
    }
  }
}
