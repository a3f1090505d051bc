// The registers of the model of AXI DMA for firm/dma_device.hpp.
#pragma once

#include <firm/dma_device.hpp>

#include <memory>
#include <mutex>
#include <string>

#include "engine_client.h"

class EngineRegisters : public firm::DmaRegisters {
 public:
  explicit EngineRegisters(const std::string& path) : engine_(engine_connect(path.c_str())) {}

  std::uint32_t read(std::size_t offset) override { return access(offset, 0); }
  void write(std::size_t offset, std::uint32_t value) override { access(offset + 1, value); }

 private:
  std::uint32_t access(std::size_t offset, std::uint32_t value) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return engine_access(engine_.get(), static_cast<std::uint32_t>(offset), value);
  }

  firm::Descriptor engine_;
  std::mutex mutex_;
};

inline std::unique_ptr<firm::DmaRegisters> engine_registers(const std::string& root) {
  return std::make_unique<EngineRegisters>(root + "/registers");
}
