// SPDX-License-Identifier: Apache-2.0
// The registers of a status with AXI4-Lite under Linux (docs/reference/status.md):
//
//     firm::StatusRegisters registers("axi:/dev/uio1");
//     firm::check_digest(registers, digest, "robot");
//
// The counterpart in Python is fusesoc_firm/node/transport/status_registers.py. C++17, Linux.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>

#include <firm/dma_device.hpp>
#include <firm/status_exchange.hpp>
#include <firm/transport.hpp>

namespace firm {

class StatusRegisters {
 public:
  // `address` is that of a UIO device, such as axi:/dev/uio1; if it is empty, the device is the one that the overlay of
  // `firm system bring-up` names. All paths begin with `root`. Throws TransportError.
  explicit StatusRegisters(const std::string& address, const std::string& root = "")
      : registers_(root + device(address, root), checked_size(device(address, root), root)) {}

  // Return the word of the register at an address. Throws TransportError if the address is invalid.
  std::uint32_t read(std::uint32_t address) { return registers_.read(offset(address)); }

  // Return the answer to a request of the status. Any thread may call this function. Throws TransportError.
  Bytes access(const Bytes& request) {
    const auto address = status_address(request);
    if (!address) throw TransportError("the frame is not a request of the status");
    const std::uint32_t before = read(*address & ~kStatusWrite);
    if (*address & kStatusWrite) {
      registers_.write(offset(*address & ~kStatusWrite), little_endian(request, kFrameHeaderBytes + 4));
    }
    // An answer has the form of a request.
    return status_request(*address, before);
  }

 private:
  // Beyond the registers of the channel with the highest number.
  static constexpr std::size_t kMapBytes = 1 << 16;
  static constexpr char kDevices[] = "/sys/class/uio";
  static constexpr char kOverlayName[] = "firm-status";
  static constexpr char kKind[] = "axi:";

  static std::size_t offset(std::uint32_t address) {
    if (address >= kMapBytes) throw TransportError("the status has no register at " + std::to_string(address));
    return address;
  }

  static std::string device(const std::string& address, const std::string& root) {
    if (address.empty()) return overlay_device(root);
    const std::string kind(kKind);
    if (address.size() <= kind.size() || address.compare(0, kind.size(), kind) != 0) {
      throw TransportError("the status is '" + address + "'; legal: axi:UIO, such as axi:/dev/uio1");
    }
    return address.substr(kind.size());
  }

  static std::string overlay_device(const std::string& root) {
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator(root + kDevices, error)) {
      std::string name;
      if (std::getline(std::ifstream(entry.path() / "name") >> std::ws, name) && name == kOverlayName) {
        return "/dev/" + entry.path().filename().string();
      }
    }
    throw TransportError(std::string("no UIO device is called ") + kOverlayName +
                         "; '--status axi:UIO' names the device of the status");
  }

  static std::size_t checked_size(const std::string& uio, const std::string& root) {
    const std::string name = uio.substr(uio.rfind('/') + 1);
    const auto size = number_in(root + kDevices + "/" + name + "/maps/map0/size");
    if (size < kMapBytes) {
      throw TransportError(uio + " has a map of " + std::to_string(size) + " bytes; a status has " +
                           std::to_string(kMapBytes));
    }
    return static_cast<std::size_t>(size);
  }

  MappedDmaRegisters registers_;
};

}  // namespace firm
