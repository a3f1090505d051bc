// The pins of firm_wiznet_node with an SPI slave outside, and the ROM of a file.
//
//   node ROM MODE HALF_BIT MISO_DELAY STALL_PERCENT SEED [strict]
//
// Standard output and input are those of slave.h. Each 's' is answered with a number of milliseconds (a byte), and the
// number (2 bytes, big-endian) and the bytes of what the Manager offers from then on, each as a word with 256 added to
// the last byte of a frame, and 512 to that of an aborted one. 'g' and 'l' are bytes for the
// Manager, 'l' the last of a frame. A strict Manager takes nothing while it offers something.
#include "Vfirm_wiznet_node.h"
#include "slave.h"

class Board : public Slave {
 public:
  using Slave::Slave;
  void selected() override {
    milliseconds += take();
    for (unsigned left = take_word(); left > 0; --left) offered.push_back(take_word());
  }

  unsigned milliseconds = 0;
  std::deque<unsigned> offered;
};

class Bench {
 public:
  Bench(std::vector<uint8_t> rom, const Board& board, const Chance& chance, bool is_strict)
      : rom_(std::move(rom)), board_(board), chance_(chance), is_strict_(is_strict) {
    top_.rst_n = 0;
    for (int count = 0; count < 4; ++count) step();
    top_.rst_n = 1;
  }

  void step() {
    const unsigned address = top_.rom_address;
    auto& offered = board_.offered;
    top_.ms = board_.milliseconds > 0;
    board_.milliseconds -= top_.ms;
    top_.s_axis_tvalid = !offered.empty() && (top_.s_axis_tvalid || !chance_.stalls());
    top_.s_axis_tdata = offered.empty() ? 0 : offered.front() & 0xFF;
    top_.s_axis_tlast = !offered.empty() && offered.front() & 0x100;
    top_.s_axis_tuser = !offered.empty() && offered.front() & 0x200;
    top_.m_axis_tready = !chance_.stalls() && !(is_strict_ && !offered.empty());
    top_.spi_miso = board_.miso();
    top_.clk = 0;
    top_.eval();
    if (top_.rst_n && top_.m_axis_tvalid && top_.m_axis_tready) {
      std::putchar(top_.m_axis_tlast ? 'l' : 'g');
      tell(static_cast<char>(top_.m_axis_tdata));
    }
    const bool is_taken = top_.s_axis_tvalid && top_.s_axis_tready;
    top_.clk = 1;
    top_.eval();
    if (is_taken) {
      offered.pop_front();
      top_.s_axis_tvalid = 0;
    }
    top_.rom_data = address < rom_.size() ? rom_[address] : 0;
    board_.step(top_.spi_cs_n, top_.spi_sck, top_.spi_mosi);
    ++cycle;
  }

 private:
  std::vector<uint8_t> rom_;
  Vfirm_wiznet_node top_;
  Board board_;
  Chance chance_;
  bool is_strict_;
};

int main(int count, char** words) {
  const auto number = [words](int index) { return static_cast<unsigned>(std::atoi(words[index])); };
  std::FILE* file = std::fopen(words[1], "rb");
  if (!file) fail("the ROM cannot be read");
  std::vector<uint8_t> rom(65536);
  rom.resize(std::fread(rom.data(), 1, rom.size(), file));
  Bench bench(rom, Board(number(2), number(3), number(4)), Chance(number(6), number(5)), count > 7);
  for (;;) bench.step();
}
