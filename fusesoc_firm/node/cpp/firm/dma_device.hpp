// SPDX-License-Identifier: Apache-2.0
// AXI DMA for a driver in user space under Linux: registers and interrupt through UIO, and memory shared by processor
// and engine through u-dma-buf (https://github.com/ikwzm/udmabuf). docs/reference/node-library.md describes the device
// tree that this needs.
#pragma once

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include <firm/descriptor.hpp>
#include <firm/transport.hpp>

namespace firm {

// The engine's registers at their offsets in bytes, the only access that the driver has. A test gives it a model of the
// engine.
class DmaRegisters {
 public:
  virtual ~DmaRegisters() = default;
  virtual std::uint32_t read(std::size_t offset) = 0;
  virtual void write(std::size_t offset, std::uint32_t value) = 0;
};

// The engine as its driver sees it.
class DmaDevice : public DmaRegisters {
 public:
  // Uncached memory that processor and engine share, and the address of its first byte as the engine sees it.
  virtual std::uint8_t* memory() = 0;
  virtual std::size_t memory_bytes() const = 0;
  virtual std::uint32_t address() const = 0;
  // Sleep until an unacknowledged interrupt of S2MM, until the deadline, or until end().
  virtual void wait(const Deadline& deadline) = 0;
  virtual void end() = 0;
};

// A device file, opened. Throws TransportError.
inline Descriptor opened(const std::string& path) {
  Descriptor file(::open(path.c_str(), O_RDWR | O_SYNC | O_CLOEXEC));
  if (file.get() < 0) fail_with_errno(path);
  return file;
}

// A memory mapping of a device file.
class Mapping {
 public:
  Mapping(const std::string& path, std::size_t size) : size_(size) {
    const Descriptor file = opened(path);
    place_ = ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, file.get(), 0);
    if (place_ == MAP_FAILED) fail_with_errno("mmap of " + path);
  }
  ~Mapping() { ::munmap(place_, size_); }
  Mapping(const Mapping&) = delete;
  Mapping& operator=(const Mapping&) = delete;

  void* place() const { return place_; }
  std::size_t size() const { return size_; }

 private:
  std::size_t size_;
  void* place_ = nullptr;
};

// The number in a device's one-line file. Throws TransportError.
inline std::uint64_t number_in(const std::string& path) {
  std::ifstream file(path);
  std::string text;
  if (!(file >> text)) throw TransportError("cannot read " + path + "; check whether the driver is loaded");
  try {
    return std::stoull(text, nullptr, 0);
  } catch (const std::exception&) {
    throw TransportError(path + " contains '" + text + "', which is not a number");
  }
}

// The registers in the first map of a UIO device.
class MappedDmaRegisters : public DmaRegisters {
 public:
  MappedDmaRegisters(const std::string& path, std::size_t size) : mapping_(path, size) {}
  std::uint32_t read(std::size_t offset) override { return at(offset); }
  void write(std::size_t offset, std::uint32_t value) override { at(offset) = value; }

 private:
  volatile std::uint32_t& at(std::size_t offset) const {
    return static_cast<volatile std::uint32_t*>(mapping_.place())[offset / sizeof(std::uint32_t)];
  }

  Mapping mapping_;
};

class LinuxDmaDevice : public DmaDevice {
 public:
  // `uio` is a device such as /dev/uio0, whose first map holds the registers, unless they are given; `buffer` is a name
  // such as udmabuf0. Without an interrupt, the registers are polled every 50 us. All paths begin with `root`. Throws
  // TransportError.
  LinuxDmaDevice(const std::string& uio, const std::string& buffer, bool has_interrupt, const std::string& root = "",
                 std::unique_ptr<DmaRegisters> registers = nullptr)
      : registers_(registers ? std::move(registers)
                             : std::make_unique<MappedDmaRegisters>(root + uio, register_bytes(uio, root))),
        uio_(opened(root + uio)),
        address_(checked_address(buffer, root)),
        memory_(root + "/dev/" + buffer, static_cast<std::size_t>(number_in(folder(buffer, root) + "/size"))),
        has_interrupt_(has_interrupt) {}

  std::uint32_t read(std::size_t offset) override { return registers_->read(offset); }
  void write(std::size_t offset, std::uint32_t value) override { registers_->write(offset, value); }
  std::uint8_t* memory() override { return static_cast<std::uint8_t*>(memory_.place()); }
  std::size_t memory_bytes() const override { return memory_.size(); }
  std::uint32_t address() const override { return address_; }

  void wait(const Deadline& deadline) override {
    if (!has_interrupt_) {
      std::this_thread::sleep_for(std::chrono::microseconds(50));
      return;
    }
    // The kernel disables the interrupt when it occurs.
    const std::uint32_t on = 1;
    if (::write(uio_.get(), &on, sizeof on) != sizeof on) fail_with_errno("the interrupt");
    std::uint32_t count;
    if (waiter_.wait(uio_.get(), POLLIN, deadline) &&
        ::read(uio_.get(), &count, sizeof count) != sizeof count) {
      fail_with_errno("the interrupt");
    }
  }

  void end() override { waiter_.end(); }

 private:
  // Of descriptors and buffers: the widest stream's beat.
  static constexpr std::size_t kAlignment = 64;

  static std::size_t register_bytes(const std::string& uio, const std::string& root) {
    const std::string name = uio.substr(uio.rfind('/') + 1);
    return static_cast<std::size_t>(number_in(root + "/sys/class/uio/" + name + "/maps/map0/size"));
  }

  // The folder in which u-dma-buf describes a buffer; older releases use another name.
  static std::string folder(const std::string& buffer, const std::string& root) {
    const std::string now = root + "/sys/class/u-dma-buf/" + buffer;
    return ::access(now.c_str(), F_OK) == 0 ? now : root + "/sys/class/udmabuf/" + buffer;
  }

  static std::uint32_t checked_address(const std::string& buffer, const std::string& root) {
    const std::string about = folder(buffer, root);
    const std::uint64_t address = number_in(about + "/phys_addr"), size = number_in(about + "/size");
    if (address + size > std::uint64_t{1} << 32) {
      throw TransportError(buffer + " ends beyond the 4 GiB that the DMA engine reaches");
    }
    if (address % kAlignment != 0) {
      throw TransportError(buffer + " begins at " + std::to_string(address) + ", which is not a multiple of 64");
    }
    // Neither cached nor mapped as device memory, which allows only aligned accesses.
    if (!(std::ofstream(about + "/sync_mode") << 2 << std::flush)) {
      throw TransportError("cannot write " + about + "/sync_mode");
    }
    return static_cast<std::uint32_t>(address);
  }

  std::unique_ptr<DmaRegisters> registers_;
  Descriptor uio_;
  std::uint32_t address_;
  Mapping memory_;
  bool has_interrupt_;
  Waiter waiter_;
};

}  // namespace firm
