// SPDX-License-Identifier: Apache-2.0
// A board's serial link (cores/board/README.md): raw frames, byte by byte, 8 bits, no parity.
//
// A byte stream does not mark the start of a frame. To the board, a break marks it: the next byte begins a frame. From
// the board, only silence marks it: all bytes are dropped until the line is silent, and in this time nothing is sent
// that would cause a response. The transport uses both markers when it is opened, and whenever received bytes cannot
// form a frame: after an illegal id or length, or a pause in the middle of a frame.
#pragma once

#include <fcntl.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <utility>

#include <firm/descriptor.hpp>
#include <firm/frame_stream.hpp>
#include <firm/transport.hpp>

namespace firm {

struct UartOptions {
  unsigned baud = 1000000;
  bool has_flow_control = false;  // RTS and CTS
  std::chrono::nanoseconds silence = std::chrono::milliseconds(50);        // that separates new bytes from old ones
  std::chrono::nanoseconds longest_pause = std::chrono::milliseconds(200);  // in the middle of a frame from the board
  std::chrono::nanoseconds patience = std::chrono::seconds(2);               // longest wait for a silent line
  std::function<int(int descriptor)> send_break = [](int descriptor) { return ::tcsendbreak(descriptor, 0); };
};

class UartTransport : public Transport {
 public:
  // Open the device and resynchronise with a break. Throws TransportError.
  explicit UartTransport(const std::string& device, TransportOptions options = {}, UartOptions uart = {})
      : options_(std::move(options)),
        uart_(std::move(uart)),
        device_(device),
        line_(::open(device.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK)),
        stream_(options_.publishers, options_.longest_payload) {
    if (line_.get() < 0) fail_with_errno(device_);
    configure();
    cut();
    const Deadline deadline(uart_.patience);
    while (is_dropping_ && !deadline.is_over()) receive_within(deadline);
    if (is_dropping_) throw TransportError(device_ + ": the board is never silent, so the start of a frame cannot be found");
  }

  void send(const std::uint8_t* frame, std::size_t size) override {
    wait_for_silence();
    const std::lock_guard<std::mutex> lock(sending_);
    make_wanted_break();
    while (size > 0) {
      throw_if_closed();
      const ssize_t written = ::write(line_.get(), frame, size);
      if (written > 0) {
        frame += written;
        size -= static_cast<std::size_t>(written);
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
      if (receive_within(deadline)) return Burst{stream_.pop()};
    } while (!is_closed_ && !deadline.is_over());
    return std::nullopt;
  }

  void close() override {
    is_closed_ = true;
    waiter_.end();
    set_dropping(false);
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
    const bool is_timed = is_dropping_ || stream_.has_begun();
    const Deadline pause = Deadline::at(moved_ + (is_dropping_ ? uart_.silence : uart_.longest_pause));
    if (waiter_.wait(line_.get(), POLLIN, is_timed ? deadline.or_earlier(pause) : deadline)) {
      fill();
    } else if (!is_closed_ && is_timed && pause.is_over()) {
      if (is_dropping_) {
        set_dropping(false);
      } else {
        lose();
      }
    }
    return false;
  }

  // Resynchronise both sides with a break. A frame that is being sent is finished first. The receiver must not wait for
  // this, because the board may accept more only after its own bytes are received.
  void cut() {
    set_dropping(true);
    stream_.pop();
    is_break_wanted_ = true;
    const std::unique_lock<std::mutex> lock(sending_, std::try_to_lock);
    if (lock) make_wanted_break();
    moved_ = std::chrono::steady_clock::now();
  }

  void make_wanted_break() {
    if (!is_break_wanted_.exchange(false)) return;
    if (uart_.send_break(line_.get()) != 0) fail_with_errno("a break at " + device_);
  }

  void lose() {
    if (options_.on_error) options_.on_error({});
    cut();
  }

  // Move received bytes to the frame; return whether it is complete.
  bool take() {
    const std::uint8_t* bytes = buffer_.data() + read_;
    const std::size_t count = filled_ - read_;
    if (is_dropping_) {
      read_ = filled_;
      return false;
    }
    try {
      read_ += stream_.push(bytes, count);
    } catch (const FrameError&) {
      read_ = filled_;
      lose();
      return false;
    }
    return stream_.is_whole();
  }

  void fill() {
    const ssize_t found = ::read(line_.get(), buffer_.data(), buffer_.size());
    if (found < 0 && (errno == EAGAIN || errno == EINTR)) return;
    if (found < 0) fail_with_errno(device_);
    if (found == 0) throw TransportError(device_ + ": the device is lost");
    read_ = 0;
    filled_ = static_cast<std::size_t>(found);
    moved_ = std::chrono::steady_clock::now();
  }

  void set_dropping(bool is_dropping) {
    const std::lock_guard<std::mutex> lock(dropping_);
    is_dropping_ = is_dropping;
    changed_.notify_all();
  }

  void wait_for_silence() {
    std::unique_lock<std::mutex> lock(dropping_);
    changed_.wait(lock, [this] { return !is_dropping_ || is_closed_; });
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
  std::mutex sending_;  // held for a frame or a break
  std::atomic<bool> is_break_wanted_{false};
  std::mutex dropping_;
  std::condition_variable changed_;
  std::atomic<bool> is_dropping_{false};  // drop received bytes until the line is silent

  // Used by the receiver only.
  FrameStream stream_;
  std::chrono::steady_clock::time_point moved_;  // time of the last received bytes
  std::array<std::uint8_t, 4096> buffer_;
  std::size_t read_ = 0;
  std::size_t filled_ = 0;
};

}  // namespace firm
