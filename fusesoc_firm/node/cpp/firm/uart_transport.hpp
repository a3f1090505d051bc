// SPDX-License-Identifier: Apache-2.0
// A board's serial link (cores/board/README.md): 8 bits, no parity, frames as in firm/link_code.hpp.
//
// A frame from the board that has a wrong checksum is dropped and reported, and the next one is received. When it is
// opened, the transport sends a break, which ends a frame that an earlier host has begun.
#pragma once

#include <fcntl.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <functional>
#include <mutex>
#include <string>
#include <utility>

#include <firm/descriptor.hpp>
#include <firm/link_code.hpp>
#include <firm/transport.hpp>

namespace firm {

struct UartOptions {
  unsigned baud = 1000000;
  bool has_flow_control = false;  // RTS and CTS
  std::function<int(int descriptor)> send_break = [](int descriptor) { return ::tcsendbreak(descriptor, 0); };
};

class UartTransport : public Transport {
 public:
  // Open the device and send a break. Throws TransportError.
  explicit UartTransport(const std::string& device, TransportOptions options = {}, UartOptions uart = {})
      : options_(std::move(options)),
        uart_(std::move(uart)),
        device_(device),
        line_(::open(device.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK)),
        decoder_(options_.longest_payload) {
    if (line_.get() < 0) fail_with_errno(device_);
    configure();
    // Waiting bytes in both directions are those of an earlier host.
    if (::tcflush(line_.get(), TCIOFLUSH) != 0) fail_with_errno(device_);
    if (uart_.send_break(line_.get()) != 0) fail_with_errno("a break at " + device_);
  }

  void send(const std::uint8_t* frame, std::size_t size) override {
    const Bytes coded = link_encoded(frame, size);
    const std::uint8_t* next = coded.data();
    std::size_t left = coded.size();
    const std::lock_guard<std::mutex> lock(sending_);
    while (left > 0) {
      throw_if_closed();
      const ssize_t written = ::write(line_.get(), next, left);
      if (written > 0) {
        next += written;
        left -= static_cast<std::size_t>(written);
      } else if (written < 0 && errno != EAGAIN && errno != EINTR) {
        fail_with_errno(device_);
      } else {
        waiter_.wait(line_.get(), POLLOUT, Deadline(std::nullopt));
      }
    }
  }

  std::optional<Burst> receive(Timeout timeout = std::nullopt) override {
    const Deadline deadline(timeout);
    do {
      if (receive_within(deadline)) return Burst{decoder_.pop()};
    } while (!is_closed_ && !deadline.is_over());
    return std::nullopt;
  }

  void close() override {
    is_closed_ = true;
    waiter_.end();
  }

 private:
  static speed_t speed(unsigned baud) {
    struct Rate {
      unsigned baud;
      speed_t speed;
    };
    static constexpr Rate kRates[] = {
        {9600, B9600},       {19200, B19200},     {38400, B38400},     {57600, B57600},     {115200, B115200},
        {230400, B230400},   {460800, B460800},   {500000, B500000},   {576000, B576000},   {921600, B921600},
        {1000000, B1000000}, {1152000, B1152000}, {1500000, B1500000}, {2000000, B2000000}, {2500000, B2500000},
        {3000000, B3000000}, {3500000, B3500000}, {4000000, B4000000}};
    std::string legal;
    for (const auto& rate : kRates) {
      if (rate.baud == baud) return rate.speed;
      legal += (legal.empty() ? "" : ", ") + std::to_string(rate.baud);
    }
    throw TransportError("the baud rate is " + std::to_string(baud) + "; legal: " + legal);
  }

  void configure() {
    termios settings;
    if (::tcgetattr(line_.get(), &settings) != 0) fail_with_errno(device_);
    ::cfmakeraw(&settings);
    settings.c_cflag |= CLOCAL | CREAD | CS8;
    settings.c_cflag &= ~(PARENB | CSTOPB | HUPCL | (uart_.has_flow_control ? 0U : CRTSCTS));
    if (uart_.has_flow_control) settings.c_cflag |= CRTSCTS;
    const speed_t speed = UartTransport::speed(uart_.baud);
    if (::cfsetispeed(&settings, speed) != 0 || ::cfsetospeed(&settings, speed) != 0 ||
        ::tcsetattr(line_.get(), TCSANOW, &settings) != 0) {
      fail_with_errno(device_ + " at " + std::to_string(uart_.baud) + " baud");
    }
    // If two programs read one line, both get fragments.
    if (::ioctl(line_.get(), TIOCEXCL) != 0) fail_with_errno(device_);
  }

  // Take available bytes, or wait for them; return whether a frame is complete.
  bool receive_within(const Deadline& deadline) {
    if (read_ < filled_) return take();
    if (waiter_.wait(line_.get(), POLLIN, deadline)) fill();
    return false;
  }

  // Move received bytes to the frame; return whether it is complete.
  bool take() {
    while (read_ < filled_) {
      const LinkEvent event = decoder_.push(buffer_[read_++]);
      if (event == LinkEvent::kFrame) return true;
      if (event == LinkEvent::kBroken && options_.on_error) options_.on_error({});
    }
    return false;
  }

  void fill() {
    const ssize_t found = ::read(line_.get(), buffer_.data(), buffer_.size());
    if (found < 0 && (errno == EAGAIN || errno == EINTR)) return;
    if (found < 0) fail_with_errno(device_);
    if (found == 0) throw TransportError(device_ + ": the device is lost");
    read_ = 0;
    filled_ = static_cast<std::size_t>(found);
  }

  void throw_if_closed() const {
    if (is_closed_) throw TransportError("the transport is closed");
  }

  const TransportOptions options_;
  const UartOptions uart_;
  const std::string device_;
  Descriptor line_;
  Waiter waiter_;
  std::atomic<bool> is_closed_{false};
  std::mutex sending_;

  // Used by the receiver only.
  LinkDecoder decoder_;
  std::array<std::uint8_t, 4096> buffer_;
  std::size_t read_ = 0;
  std::size_t filled_ = 0;
};

}  // namespace firm
