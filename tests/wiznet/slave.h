// A bench's SPI slave, whose bytes are outside: it sees 's' (select), 't' and a byte, 'd' (deselect) at standard output; to
// 'a' it answers with a byte at standard input.
#pragma once

#include <deque>

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

  virtual ~Slave() = default;
  virtual void selected() {}  // follows each 's'

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
    if (!cs_n) selected();
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
