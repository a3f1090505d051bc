// SPDX-License-Identifier: Apache-2.0
// Sends the frames of a file with random stalls, and prints the frames that come, in hexadecimal digits:
//
//     Vsoc FRAMES SEED STALL_PERCENT [ADDRESS | ADDRESS=WORD]...
//
// Then it reads and writes registers, in this order, and prints the words that it reads. HAS_REGISTERS is 0 or 1.
#include <algorithm>

#include "Vsoc.h"
#include "bench.h"

static const uint64_t QUIET = 5000;  // cycles without a beat, after which no frame comes

class Bench {
 public:
  Bench(uint64_t seed, unsigned percent) : chance_(seed, percent) {
    top_.s_axis_tvalid = top_.s_axis_tuser = top_.m_axis_tready = 0;
#if HAS_REGISTERS
    top_.s_axi_arvalid = top_.s_axi_rready = top_.s_axi_awvalid = top_.s_axi_wvalid = top_.s_axi_bready = 0;
#endif
    reset(top_);
  }

  void stream(const std::vector<std::vector<uint8_t>>& frames) {
    std::size_t number = 0, place = 0;
    for (uint64_t last = cycle; cycle - last < QUIET;) {
      if (!top_.s_axis_tvalid && number < frames.size() && !chance_.stalls()) offer(frames[number], place);
      top_.m_axis_tready = !chance_.stalls();
      settle();
      const bool is_taken = top_.s_axis_tvalid && top_.s_axis_tready, has_come = top_.m_axis_tvalid && top_.m_axis_tready;
      if (has_come) take();
      edge();
      if (is_taken || has_come) last = cycle;
      if (!is_taken) continue;
      top_.s_axis_tvalid = 0;
      place += LANES;
      if (place >= frames[number].size()) ++number, place = 0;
    }
    if (number < frames.size()) fail("the system takes no beat");
    if (!bytes_.empty()) fail("the last frame is incomplete");
  }

#if HAS_REGISTERS
  uint32_t read(uint32_t address) {
    top_.s_axi_araddr = address;
    top_.s_axi_arvalid = top_.s_axi_rready = 1;
    for (uint64_t first = cycle; cycle - first < WATCHDOG;) {
      settle();
      const bool is_accepted = top_.s_axi_arready, has_answered = top_.s_axi_rvalid;
      const uint32_t word = top_.s_axi_rdata, response = top_.s_axi_rresp;
      edge();
      if (is_accepted) top_.s_axi_arvalid = 0;
      if (!has_answered) continue;
      top_.s_axi_rready = 0;
      if (response) fail("a read has failed");
      return word;
    }
    fail("a read has no answer");
  }

  void write(uint32_t address, uint32_t word) {
    top_.s_axi_awaddr = address;
    top_.s_axi_wdata = word;
    top_.s_axi_wstrb = 15;
    top_.s_axi_awvalid = top_.s_axi_wvalid = top_.s_axi_bready = 1;
    for (uint64_t first = cycle; cycle - first < WATCHDOG;) {
      settle();
      const bool is_addressed = top_.s_axi_awready, is_taken = top_.s_axi_wready, has_answered = top_.s_axi_bvalid;
      const uint32_t response = top_.s_axi_bresp;
      edge();
      if (is_addressed) top_.s_axi_awvalid = 0;
      if (is_taken) top_.s_axi_wvalid = 0;
      if (!has_answered) continue;
      top_.s_axi_bready = 0;
      if (response) fail("a write has failed");
      return;
    }
    fail("a write has no answer");
  }
#endif

 private:
  void settle() {
    top_.clk = 0;
    top_.eval();
  }

  void edge() {
    top_.clk = 1;
    top_.eval();
    ++cycle;
  }

  void offer(const std::vector<uint8_t>& frame, std::size_t place) {
    std::vector<uint8_t> beat(frame.begin() + place, frame.begin() + std::min(place + LANES, frame.size()));
    top_.s_axis_tkeep = (1u << beat.size()) - 1;
    beat.resize(LANES, 0xaa);
    set(top_.s_axis_tdata, beat);
    top_.s_axis_tlast = place + LANES >= frame.size();
    top_.s_axis_tvalid = 1;
  }

  void take() {
    if (top_.m_axis_tuser) fail("a frame is aborted");
    for (unsigned lane = 0; lane < LANES; ++lane)
      if (top_.m_axis_tkeep >> lane & 1) append(bytes_, byte_of(top_.m_axis_tdata, lane), 1);
    if (!top_.m_axis_tlast) return;
    for (const char byte : bytes_) std::printf("%02x", static_cast<uint8_t>(byte));
    std::puts("");
    bytes_.clear();
  }

  Vsoc top_;
  Chance chance_;
  std::string bytes_;
  static const unsigned LANES = sizeof(Vsoc::s_axis_tdata);
};

int main(int count, char** words) {
  Bench bench(std::strtoull(words[2], nullptr, 10), std::atoi(words[3]));
  bench.stream(read_strings(words[1]));
#if HAS_REGISTERS
  for (int number = 4; number < count; ++number) {
    char* end;
    const uint32_t address = std::strtoul(words[number], &end, 16);
    if (*end == '=')
      bench.write(address, std::strtoul(end + 1, nullptr, 16));
    else
      std::printf("%08x\n", bench.read(address));
  }
#endif
}
