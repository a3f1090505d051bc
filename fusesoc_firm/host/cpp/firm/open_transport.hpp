// SPDX-License-Identifier: Apache-2.0
// A transport by its address, as it stands in a launch file or on a command line (docs/transport.md).
//
//     pipe:COMMAND                      a simulator
#pragma once

#include <memory>
#include <string>
#include <utility>

#include <firm/pipe_transport.hpp>
#include <firm/transport.hpp>

namespace firm {

// Throws TransportError, also for an address that is none.
inline std::unique_ptr<Transport> open_transport(const std::string& address, TransportOptions options = {}) {
  const auto colon = address.find(':');
  const std::string kind = address.substr(0, colon);
  const std::string rest = colon == std::string::npos ? "" : address.substr(colon + 1);
  if (kind == "pipe" && !rest.empty()) return std::make_unique<PipeTransport>(rest, std::move(options));
  throw TransportError("the transport is '" + address + "'; legal: pipe:COMMAND");
}

}  // namespace firm
