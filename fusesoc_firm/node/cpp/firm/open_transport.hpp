// SPDX-License-Identifier: Apache-2.0
// Opens a transport by its address, as given in a launch file or on a command line (docs/reference/transports.md):
//
//     pipe:COMMAND                      a simulator
//     uart:DEVICE:BAUD[:rtscts]         a serial link, with flow control by wires
//     dma:UIO:BUFFER[:poll]             AXI DMA, such as dma:/dev/uio0:udmabuf0, without its interrupt
//     software:COMMAND                  blocks in software
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <firm/dma_transport.hpp>
#include <firm/pipe_transport.hpp>
#include <firm/software_transport.hpp>
#include <firm/transport.hpp>
#include <firm/uart_transport.hpp>

namespace firm {

// The parts of an address. Device names may hold colons, so the option and the part before it are split off from the
// end.
struct TransportAddress {
  std::string kind;
  std::string first;   // for a command, everything after the kind
  std::string second;  // empty if missing
  bool has_option = false;

  // Throws TransportError.
  static TransportAddress of(const std::string& address) {
    const auto colon = address.find(':');
    TransportAddress parts{address.substr(0, colon), colon == std::string::npos ? "" : address.substr(colon + 1), ""};
    const bool is_command = parts.kind == "pipe" || parts.kind == "software";
    const bool is_device = parts.kind == "uart" || parts.kind == "dma";
    if (is_device) {
      parts.has_option = parts.drop_end(parts.kind == "uart" ? ":rtscts" : ":poll");
      if (const auto last = parts.first.rfind(':'); last != std::string::npos) {
        parts.second = parts.first.substr(last + 1);
        parts.first.erase(last);
      }
    }
    if (parts.first.empty() || !(is_command || (is_device && !parts.second.empty()))) {
      throw TransportError("the transport is '" + address +
                           "'; legal: pipe:COMMAND, uart:DEVICE:BAUD[:rtscts], dma:UIO:BUFFER[:poll], software:COMMAND");
    }
    return parts;
  }

  // The second part as a number. Throws TransportError.
  unsigned number() const {
    constexpr std::size_t kMostDigits = 9;
    if (second.size() > kMostDigits || second.find_first_not_of("0123456789") != std::string::npos) {
      throw TransportError("the baud rate is '" + second + "', which is not a number");
    }
    return static_cast<unsigned>(std::stoul(second));
  }

 private:
  bool drop_end(const std::string& end) {
    if (first.size() < end.size() || first.compare(first.size() - end.size(), end.size(), end) != 0) return false;
    first.erase(first.size() - end.size());
    return true;
  }
};

// Return whether the hardware at an address is a simulator. Throws TransportError for an illegal address.
inline bool is_simulated(const std::string& address) { return TransportAddress::of(address).kind == "pipe"; }

// Open the transport at an address. Throws TransportError, also for an illegal address.
inline std::unique_ptr<Transport> open_transport(const std::string& address, TransportOptions options = {}) {
  const auto parts = TransportAddress::of(address);
  if (parts.kind == "pipe") return std::make_unique<PipeTransport>(parts.first, std::move(options));
  if (parts.kind == "software") return std::make_unique<SoftwareTransport>(parts.first, std::move(options));
  if (parts.kind == "dma") {
    auto device = std::make_unique<LinuxDmaDevice>(parts.first, parts.second, !parts.has_option);
    return std::make_unique<DmaTransport>(std::move(device), std::move(options));
  }
  UartOptions uart;
  uart.baud = parts.number();
  uart.has_flow_control = parts.has_option;
  return std::make_unique<UartTransport>(parts.first, std::move(options), std::move(uart));
}

}  // namespace firm
