// SPDX-License-Identifier: Apache-2.0
// The node at a TAP device; its milliseconds are those of the wall clock. It prints `{"ready": true}` when the
// device is up, then `{"peers": number}` at each change, and ends with its standard input.
#include <chrono>

#include "Vnet_node.h"
#include "tap.h"

// Cycles without a byte in either direction, after which nothing happens before a frame or a millisecond comes.
static const uint64_t QUIET = 600;

static uint64_t now() {
  using std::chrono::duration_cast;
  return duration_cast<std::chrono::milliseconds>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

int main() {
  const Tap tap;
  Board<Vnet_node> board;
  std::puts("{\"ready\": true}");
  std::fflush(stdout);
  uint8_t known = 0;
  uint64_t ticked = now();
  while (tap.wait(1)) {
    for (uint64_t quiet = 0; quiet < QUIET; ++quiet) {
      const uint64_t time = now();
      board.top().tick = ticked < time;
      ticked += ticked < time;
      if (board.step(tap)) quiet = 0;
    }
    if (known != board.top().peers_known) {
      known = board.top().peers_known;
      std::printf("{\"peers\": %d}\n", __builtin_popcount(known));
      std::fflush(stdout);
    }
  }
}
