// The pins of firm_wiznet_access with an SPI slave outside. Standard input: accesses, and the slave's answers;
// standard output: what the slave sees, and each access's result.
//
//   access MODE HALF_BIT MISO_DELAY STALL_PERCENT SEED
//
// An access is 'W' or 'R', space, socket, address (2 bytes, big-endian), length (2 bytes), and the bytes to write. The
// slave sees 's' (select), 't' and a byte, 'd' (deselect); to 'a' it answers with a byte. An access ends with 'D' and
// the bytes that were read.
#include <deque>

#include "Vfirm_wiznet_access.h"
#include "bench.h"

static uint8_t take() {
  const int byte = std::getchar();
  if (byte == EOF) std::exit(0);
  return static_cast<uint8_t>(byte);
}

static unsigned take_word() {
  const unsigned high = take();
  return high << 8 | take();
}

static void tell(char what) {
  std::putchar(what);
  std::fflush(stdout);
}

// The slave shifts at falling edges and reads at rising ones. Its pin follows after a delay.
class Slave {
 public:
  Slave(unsigned mode, unsigned half_bit, unsigned delay)
      : idle_(mode == 3), half_bit_(half_bit), miso_(delay + 1, 0), sck_(idle_) {}

  uint8_t miso() const { return miso_.front(); }

  void step(bool cs_n, bool sck, bool mosi) {
    if (cs_n != cs_n_) change_select(cs_n, sck);
    if (!cs_n && sck != sck_) change_clock(sck, mosi);
    since_edge_ += 1;
    since_select_ += 1;
    if (!cs_n && sck && mosi != mosi_ && since_edge_ > 1) fail("spi_mosi changes while spi_sck is high");
    sck_ = sck;
    mosi_ = mosi;
    miso_.pop_front();
    miso_.push_back(cs_n ? 0 : shown_ >> 7 & 1);
  }

 private:
  void change_select(bool cs_n, bool sck) {
    if (sck != idle_ || sck_ != idle_) fail("spi_cs_n changes outside the idle level of spi_sck");
    if (bits_) fail("a frame ends within a byte");
    if (!cs_n && cycle > 100 && since_select_ < 2 * half_bit_) fail("spi_cs_n is high for less than a bit");
    cs_n_ = cs_n;
    since_select_ = 0;
    tell(cs_n ? 'd' : 's');
    if (!cs_n && !idle_) load();
  }
  void change_clock(bool sck, bool mosi) {
    if (since_edge_ < half_bit_) fail("spi_sck is too fast");
    since_edge_ = 0;
    if (sck) {
      taken_ = static_cast<uint8_t>(taken_ << 1 | mosi);
      if (++bits_ == 8) {
        std::putchar('t');
        tell(static_cast<char>(taken_));
        bits_ = 0;
      }
    } else if (bits_) {
      shown_ = static_cast<uint8_t>(shown_ << 1);
    } else {
      load();
    }
  }
  void load() {
    tell('a');
    shown_ = take();
  }

  bool idle_;
  unsigned half_bit_;
  std::deque<uint8_t> miso_;
  bool cs_n_ = true, sck_, mosi_ = false;
  unsigned bits_ = 0;
  uint8_t taken_ = 0, shown_ = 0;
  uint64_t since_edge_ = 1u << 20, since_select_ = 1u << 20;
};

class Bench {
 public:
  Bench(const Slave& slave, const Chance& chance) : slave_(slave), chance_(chance) {
    top_.rst_n = 0;
    for (int count = 0; count < 4; ++count) step();
    top_.rst_n = 1;
    step();
  }
  void access() {
    top_.request_write = take() == 'W';
    top_.request_space = take();
    top_.request_socket = take();
    top_.request_address = static_cast<uint16_t>(take_word());
    const unsigned length = take_word();
    top_.request_length = static_cast<uint16_t>(length);
    std::deque<uint8_t> bytes;
    for (unsigned index = 0; top_.request_write && index < length; ++index) bytes.push_back(take());
    std::string read;
    top_.request_valid = 1;
    for (bool is_done = false; !is_done;) {
      top_.s_axis_tvalid = !bytes.empty() && (top_.s_axis_tvalid || !chance_.stalls());
      top_.s_axis_tdata = bytes.empty() ? 0 : bytes.front();
      top_.m_axis_tready = !chance_.stalls();
      top_.eval();
      const bool is_requested = top_.request_valid && top_.request_ready;
      const bool is_written = top_.s_axis_tvalid && top_.s_axis_tready;
      if (top_.m_axis_tvalid && top_.m_axis_tready) read += static_cast<char>(top_.m_axis_tdata);
      step();
      if (is_requested) top_.request_valid = 0;
      if (is_written) {
        bytes.pop_front();
        top_.s_axis_tvalid = 0;
      }
      is_done = top_.is_done;
    }
    if (!bytes.empty() || read.size() != (top_.request_write ? 0 : length)) fail("an access has another length");
    std::putchar('D');
    std::fwrite(read.data(), 1, read.size(), stdout);
    std::fflush(stdout);
  }

 private:
  void step() {
    top_.spi_miso = slave_.miso();
    top_.clk = 0;
    top_.eval();
    top_.clk = 1;
    top_.eval();
    slave_.step(top_.spi_cs_n, top_.spi_sck, top_.spi_mosi);
    ++cycle;
  }

  Vfirm_wiznet_access top_;
  Slave slave_;
  Chance chance_;
};

int main(int, char** words) {
  const auto number = [words](int index) { return static_cast<unsigned>(std::atoi(words[index])); };
  Bench bench(Slave(number(1), number(2), number(3)), Chance(number(5), number(4)));
  for (;;) bench.access();
}
