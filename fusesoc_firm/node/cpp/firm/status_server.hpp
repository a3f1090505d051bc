// SPDX-License-Identifier: Apache-2.0
// Serves the status of hardware that a node uses to other processes on the same computer, such as `firm status`. The
// sockets are described in fusesoc_firm/node/status/status_socket.py. C++17, Linux.
#pragma once

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <climits>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <firm/descriptor.hpp>
#include <firm/open_transport.hpp>
#include <firm/parameters.hpp>
#include <firm/transport.hpp>

namespace firm {

// Return the names of the sockets of a node: after its system, and after the device of its transport, if it has one.
// Throws TransportError for an illegal address.
inline std::vector<std::string> served_names(const std::string& system, const std::string& address) {
  std::vector<std::string> names{"node:" + system};
  const auto parts = TransportAddress::of(address);
  if (parts.kind != "uart" && parts.kind != "dma") return names;
  char resolved[PATH_MAX];
  const bool is_there = ::realpath(parts.first.c_str(), resolved) != nullptr;
  names.push_back(parts.kind + ":" + (is_there ? resolved : parts.first));
  return names;
}

// Each name is served by a thread, one peer at a time.
class StatusServer {
 public:
  // Returns the answer to a request. Throws TransportError.
  using Access = std::function<Bytes(const Bytes&)>;

  // A name that another node has, or that is too long, is reported and not served.
  StatusServer(const std::vector<std::string>& names, Access access,
               const std::function<void(const std::string& line)>& report, std::vector<Parameter> parameters = {})
      : access_(std::move(access)), parameters_(std::move(parameters)) {
    for (const auto& name : names) {
      Descriptor listener = listen(name);
      if (listener.get() < 0) {
        report("'firm status " + name + "' cannot ask this node: " + std::strerror(errno));
      } else {
        threads_.emplace_back([this, item = std::move(listener)] { serve(item.get()); });
      }
    }
  }

  ~StatusServer() {
    waiter_.end();
    for (auto& thread : threads_) thread.join();
  }
  StatusServer(const StatusServer&) = delete;
  StatusServer& operator=(const StatusServer&) = delete;

 private:
  static constexpr char kPrefix[] = "firm status ";
  // A request for the description of a parameter begins with this word; no frame of the status does.
  static constexpr char kParameter[] = "parameter ";
  static constexpr std::size_t kLongestName = 90;
  static constexpr std::size_t kLongestPacket = 1000;
  static constexpr int kWaitingPeers = 8;
  // A peer without a request for this time must connect again.
  static constexpr std::chrono::seconds kSilence{5};

  // Return no descriptor, with errno, if the name cannot be used.
  static Descriptor listen(const std::string& name) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    // The leading zero makes the name abstract.
    const std::string path = std::string(1, '\0') + kPrefix + name;
    if (name.size() > kLongestName || path.size() > sizeof address.sun_path) {
      errno = ENAMETOOLONG;
      return Descriptor();
    }
    std::memcpy(address.sun_path, path.data(), path.size());
    Descriptor listener(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + path.size());
    if (listener.get() < 0 || ::bind(listener.get(), reinterpret_cast<const sockaddr*>(&address), size) < 0 ||
        ::listen(listener.get(), kWaitingPeers) < 0) {
      return Descriptor();
    }
    return listener;
  }

  // Return whether a process of this user or of root asks.
  static bool is_trusted(int peer) {
    ucred credentials{};
    socklen_t size = sizeof credentials;
    if (::getsockopt(peer, SOL_SOCKET, SO_PEERCRED, &credentials, &size) < 0) return false;
    return credentials.uid == 0 || credentials.uid == ::geteuid();
  }

  void serve(int listener) {
    while (waiter_.wait(listener, POLLIN, Deadline(std::nullopt))) {
      const Descriptor peer(::accept4(listener, nullptr, nullptr, SOCK_CLOEXEC));
      if (peer.get() >= 0 && is_trusted(peer.get())) answer(peer.get());
    }
  }

  // Answer a peer until it ends or is silent.
  void answer(int peer) {
    std::array<std::uint8_t, kLongestPacket> packet;
    while (waiter_.wait(peer, POLLIN, Deadline(kSilence))) {
      const auto size = ::recv(peer, packet.data(), packet.size(), 0);
      if (size <= 0) return;
      const Bytes reply = reply_to(Bytes(packet.data(), packet.data() + size));
      // A peer that does not read its replies causes no stall.
      if (::send(peer, reply.data(), reply.size(), MSG_DONTWAIT | MSG_NOSIGNAL) < 0) return;
    }
  }

  Bytes reply_to(const Bytes& request) const {
    const std::string text(request.begin(), request.end());
    if (text.rfind(kParameter, 0) == 0) return bytes_of(parameter_text(text.substr(sizeof kParameter - 1)));
    try {
      return access_(request);
    } catch (const TransportError& error) {
      return bytes_of(error.what());
    }
  }

  static Bytes bytes_of(const std::string& text) { return Bytes(text.begin(), text.end()); }

  // Return the parameter with a number as JSON, or `null` after the last one.
  std::string parameter_text(const std::string& digits) const {
    std::size_t number = parameters_.size();
    if (!(std::istringstream(digits) >> number) || number >= parameters_.size()) return "null";
    const Parameter& found = parameters_[number];
    // The name of a block has no point.
    const std::size_t point = found.name.find('.');
    std::ostringstream text;
    text.precision(17);
    text << "[\"" << found.name.substr(0, point) << "\", \"" << found.name.substr(point + 1) << "\", \"" << found.type
         << "\", " << found.initial << ", " << found.least << ", " << found.most << "]";
    return text.str();
  }

  const Access access_;
  const std::vector<Parameter> parameters_;
  Waiter waiter_;
  std::vector<std::thread> threads_;
};

}  // namespace firm
