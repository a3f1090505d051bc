// SPDX-License-Identifier: Apache-2.0
// Blocks in software with the interface of hardware: a child process that reads frames from its standard input and
// writes frames to its standard output, with its own ids (docs/reference/node-library.md, "Blocks in software").
//
// `python3 -m fusesoc_firm.node.software_process SPEC` is one; any program can serve.
#pragma once

#include <array>
#include <atomic>
#include <string>
#include <utility>

#include <firm/child_process.hpp>
#include <firm/descriptor.hpp>
#include <firm/frame_stream.hpp>
#include <firm/transport.hpp>

namespace firm {

class SoftwareTransport : public Transport {
 public:
  // Start `command`. Throws TransportError.
  explicit SoftwareTransport(const std::string& command, TransportOptions options = {})
      : stream_(options.publishers, options.longest_payload), child_(command, STDIN_FILENO, STDOUT_FILENO) {}

  void send(const std::uint8_t* frame, std::size_t size) override {
    if (is_closed_) throw TransportError("the transport is closed");
    const SigpipeHeld held;
    // The receiver, which knows how the child ended, also reports its end.
    if (!child_.write(frame, size)) throw TransportError("the software no longer accepts frames");
  }

  // Close the child's input: the software ends after its last response.
  void finish() override {
    is_finishing_ = true;
    child_.end_input();
  }

  std::optional<Burst> receive(Timeout timeout = std::nullopt) override {
    const Deadline deadline(timeout);
    while (!is_closed_) {
      if (read_ < filled_) {
        take();
        if (stream_.is_whole()) return Burst{stream_.pop()};
      } else if (is_done_ ? !waiter_.wait(-1, 0, deadline) : !waiter_.wait(child_.output(), POLLIN, deadline)) {
        return std::nullopt;
      } else {
        fill();
      }
    }
    return std::nullopt;
  }

  std::optional<bool> is_at_rest() const override { return is_done_.load(); }

  void close() override {
    is_closed_ = true;
    waiter_.end();
    child_.kill();
  }

 private:
  void take() {
    try {
      read_ += stream_.push(buffer_.data() + read_, filled_ - read_);
    } catch (const FrameError& error) {
      throw TransportError(std::string("the software sent an invalid frame: ") + error.what());
    }
  }

  void fill() {
    read_ = 0;
    filled_ = child_.read(buffer_.data(), buffer_.size());
    if (filled_ > 0) return;
    const bool is_expected = is_finishing_ && !stream_.has_begun();
    const std::string ending = child_.wait(kPatience);
    if (is_closed_) return;
    if (!is_expected || ending != "ended with status 0") throw TransportError("the software " + ending);
    is_done_ = true;
  }

  static constexpr std::chrono::seconds kPatience{2};

  std::atomic<bool> is_closed_{false};
  std::atomic<bool> is_finishing_{false};
  std::atomic<bool> is_done_{false};
  Waiter waiter_;

  // Used by the receiver only.
  FrameStream stream_;
  std::array<std::uint8_t, 1 << 16> buffer_;
  std::size_t read_ = 0;
  std::size_t filled_ = 0;

  ChildProcess child_;
};

}  // namespace firm
