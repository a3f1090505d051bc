// SPDX-License-Identifier: Apache-2.0
// The board at a TAP device. It prints "ready" when the device is up, and ends with its standard input.
#include "Vnet_board.h"
#include "tap.h"

static const uint64_t QUIET = 100;  // cycles without a byte in either direction, after which the board waits for frames

int main() {
  const Tap tap;
  Board<Vnet_board> board;
  std::puts("ready");
  std::fflush(stdout);
  while (tap.wait()) {
    for (uint64_t quiet = 0; quiet < QUIET; ++quiet) {
      if (board.step(tap)) quiet = 0;
    }
  }
}
