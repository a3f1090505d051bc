// SPDX-License-Identifier: Apache-2.0
// Events from the standard input at a node, and its results on the standard output: see firm_rtps_node_tb. The
// numbers of peers, sources and sinks, `entries`, the `cycles` until the node had nothing to do after milliseconds, and
// a line `done` follow the results of each event. `latency` is the number of cycles from the last byte of a frame to the
// first one that is sent after it. The arguments are the address of the program's loop, and of 100 cycles
// those in which the host takes nothing.
#include <cstdlib>
#include <iostream>
#include <random>
#include <sstream>

#include "Vrtps_world.h"
#include "bench.h"

static const unsigned LOOP_CYCLES = 24, IDLE_LOOPS = 10;
// Until the node takes a byte, or comes to rest: ten times what the longest messages of the tests take.
static const uint64_t MOST_CYCLES = 3000000;
enum Kind { PACKET, ABORTED_PACKET, TICKS, FRAME, ABORTED_FRAME, RUSHED };

class World {
 public:
  World(unsigned main, unsigned stall) : main_(main), stall_(stall) {
    top_.tick = top_.packet_tvalid = top_.sample_tvalid = 0;
    reset(top_);
  }
  void tick() {
    top_.tick = 1;
    step();
    top_.tick = 0;
    cycles_ = 0;
    wait();
  }
  void rush(int count) {
    top_.tick = 1;
    while (count-- > 0) step();
    top_.tick = 0;
  }
  void packet(const std::vector<int>& bytes, bool is_aborted) {
    for (std::size_t place = 0; place < bytes.size(); ++place) {
      top_.packet_tvalid = 1;
      top_.packet_tdata = bytes[place];
      top_.packet_tlast = place + 1 == bytes.size();
      top_.packet_tuser = top_.packet_tlast && is_aborted;
      step();
    }
    top_.packet_tvalid = 0;
  }
  void frame(const std::vector<int>& bytes, bool is_aborted) {
    for (std::size_t place = 0; place < bytes.size(); ++place) {
      top_.sample_tvalid = 1;
      top_.sample_tdata = bytes[place];
      top_.sample_tlast = place + 1 == bytes.size();
      top_.sample_tuser = top_.sample_tlast && is_aborted;
      top_.eval();
      run_until([this] { return top_.sample_tready; }, "the node takes no byte of a frame");
      step();
    }
    top_.sample_tvalid = 0;
    since_frame_ = 0;
    awaits_ = sent_.empty();
  }
  void wait() {
    idle_ = 0;
    run_until([this] { return idle_ >= IDLE_LOOPS; }, "the node does not come to rest");
  }
  void step() {
    top_.frame_tready = random_() % 100 >= stall_;
    top_.clk = 0;
    top_.eval();
    watch();
    top_.clk = 1;
    top_.eval();
    ++cycle;
  }

  void done() const {
    std::printf("entries %d %d %d\n", top_.peer_count, top_.source_count, top_.sink_count);
    std::printf("cycles %u\ndone\n", busy_);
  }

 private:
  template <typename Condition> void run_until(Condition is_met, const char* fault) {
    for (const uint64_t end = cycle + MOST_CYCLES; !is_met(); step()) {
      if (cycle == end) fail(fault);
    }
  }
  void watch() {
    ++since_main_;
    ++cycles_;
    ++since_frame_;
    if (top_.packet_tvalid || top_.tick || top_.sample_tvalid || top_.is_busy || top_.frame_tvalid) {
      idle_ = 0;
    } else if (top_.program_enable && top_.program_address == main_) {
      idle_ = since_main_ > LOOP_CYCLES ? 0 : idle_ + 1;
      if (idle_ == 0) busy_ = cycles_;
      since_main_ = 0;
    }
    if (top_.frame_tvalid && top_.frame_tready) collect("frame", frame_, top_.frame_tdata, top_.frame_tlast);
    if (top_.sent_tvalid && awaits_) std::printf("latency %u\n", since_frame_);
    if (top_.sent_tvalid) awaits_ = false;
    if (top_.sent_tvalid) collect("sent", sent_, top_.sent_tdata, top_.sent_tlast);
    if (top_.is_frame_refused) std::puts("refused");
    if (top_.is_sample_lost || top_.is_discovery_lost) std::puts("lost");
    if (top_.is_sample_parted) std::puts("parted");
    if (top_.is_peer_refused) std::puts("peer");
    if (top_.is_endpoint_refused) std::puts("endpoint");
  }
  static void collect(const char* name, std::string& row, unsigned byte, bool is_last) {
    row += ' ' + std::to_string(byte);
    if (!is_last) return;
    std::printf("%s%s\n", name, row.c_str());
    row.clear();
  }

  Vrtps_world top_;
  const unsigned main_, stall_;
  unsigned since_main_ = 0, since_frame_ = 0, idle_ = 0, cycles_ = 0, busy_ = 0;
  bool awaits_ = false;
  std::string frame_, sent_;
  std::mt19937 random_{20261127};
};

int main(int, char** arguments) {
  World world(std::atoi(arguments[1]), std::atoi(arguments[2]));
  for (std::string line; std::getline(std::cin, line);) {
    std::istringstream row(line);
    int kind, before, size, byte;
    row >> kind >> before >> size;
    std::vector<int> bytes;
    while (row >> byte) bytes.push_back(byte);
    if (before < 0) world.wait();
    for (int count = 0; count < before; ++count) world.step();
    if (kind == TICKS) {
      for (int count = 0; count < size; ++count) world.tick();
    } else if (kind == RUSHED) {
      world.rush(size);
    } else if (kind == FRAME || kind == ABORTED_FRAME) {
      world.frame(bytes, kind == ABORTED_FRAME);
    } else {
      world.packet(bytes, kind == ABORTED_PACKET);
    }
    world.done();
    std::fflush(stdout);
  }
}
