// What the benches of subscribers and publishers share: ports as bytes, chance, files.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "verilated.h"

static const uint64_t WATCHDOG = 20000;  // cycles without a beat of a frame

static uint64_t cycle = 0;

[[noreturn]] static void fail(const char* what) {
  std::fprintf(stderr, "cycle %llu: %s\n", static_cast<unsigned long long>(cycle), what);
  std::exit(1);
}

// The bytes of a port, the lowest first: Verilator holds up to 64 bits in an integer, more in words of 32.
template <typename T> uint8_t byte_of(const T& port, unsigned index) {
  return static_cast<uint8_t>(static_cast<uint64_t>(port) >> (8 * index));
}
template <std::size_t N> uint8_t byte_of(const VlWide<N>& port, unsigned index) {
  return static_cast<uint8_t>(port[index / 4] >> (8 * (index % 4)));
}
template <typename T> void append(std::string& bytes, const T& port, unsigned count) {
  for (unsigned index = 0; index < count; ++index) bytes += static_cast<char>(byte_of(port, index));
}
template <typename T> void set(T& port, const std::vector<uint8_t>& bytes) {
  uint64_t value = 0;
  for (std::size_t index = bytes.size(); index-- > 0;) value = value << 8 | bytes[index];
  port = static_cast<T>(value);
}
template <std::size_t N> void set(VlWide<N>& port, const std::vector<uint8_t>& bytes) {
  for (std::size_t word = 0; word < N; ++word) port[word] = 0;
  for (std::size_t index = 0; index < bytes.size(); ++index) port[index / 4] |= uint32_t(bytes[index]) << (8 * (index % 4));
}

class Chance {
 public:
  Chance(uint64_t seed, unsigned percent) : state_(seed * 0x9E3779B97F4A7C15u + 1), percent_(percent) {}
  uint64_t next() {
    state_ ^= state_ << 13;
    state_ ^= state_ >> 7;
    state_ ^= state_ << 17;
    return state_;
  }
  bool stalls() { return percent_ && next() / 65536 % 100 < percent_; }

 private:
  uint64_t state_;
  unsigned percent_;
};

// Byte strings, each with its size (uint32) in front.
static std::vector<std::vector<uint8_t>> read_strings(const char* path) {
  std::FILE* file = std::fopen(path, "rb");
  if (!file) fail("the input cannot be read");
  std::vector<std::vector<uint8_t>> strings;
  uint32_t size;
  while (std::fread(&size, 4, 1, file) == 1) {
    std::vector<uint8_t> string(size);
    if (size && std::fread(string.data(), 1, size, file) != size) fail("the input ends early");
    strings.push_back(std::move(string));
  }
  std::fclose(file);
  return strings;
}

template <typename Top> void reset(Top& top) {
  top.rst_n = 0;
  for (; cycle < 5; ++cycle) {
    top.clk = 0;
    top.eval();
    top.clk = 1;
    top.eval();
  }
  top.rst_n = 1;
}

static unsigned long long number(uint64_t value) { return value; }
