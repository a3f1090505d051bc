// The pins of firm_wiznet_access with an SPI slave outside. Standard input: accesses, and the slave's answers;
// standard output: what the slave sees, and each access's result.
//
//   access MODE HALF_BIT MISO_DELAY STALL_PERCENT SEED
//
// An access is 'W' or 'R', space, socket, address (2 bytes, big-endian), length (2 bytes), and the bytes to write. The
// slave sees 's' (select), 't' and a byte, 'd' (deselect); to 'a' it answers with a byte. An access ends with 'D' and
// the bytes that were read.
#include "Vfirm_wiznet_access.h"
#include "slave.h"

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
