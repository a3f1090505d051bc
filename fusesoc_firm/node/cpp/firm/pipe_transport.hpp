// SPDX-License-Identifier: Apache-2.0
// A simulator as hardware: a command that serves requests through a pipe (docs/reference/transports.md,
// "A simulator's pipe").
//
// A thread sends the requests: it hands over waiting frames, lets the simulator run, and takes its reports. It sleeps
// when nothing has moved for a while. It also sleeps while received bursts are not taken, which gives back-pressure.
#pragma once

#include <algorithm>
#include <condition_variable>
#include <cstdio>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include <firm/child_process.hpp>
#include <firm/transport.hpp>

namespace firm {

struct PipeOptions {
  std::size_t frames_in_flight = 2;       // sent, but not yet taken by the system
  std::size_t bytes_waiting = 1 << 24;    // of bursts that are waiting for receive()
  // The duration of a run by the wall clock. A frame that arrives during a run waits for its end.
  std::chrono::nanoseconds run_time = std::chrono::milliseconds(1);
  // The system counts as at rest after these cycles without a beat, or after four of its own longest pauses, but not
  // after more than most_cycles_to_rest. A simulation that never sleeps would use the processor time that an arriving
  // message needs.
  std::uint32_t cycles_to_rest = 500;
  std::uint32_t most_cycles_to_rest = 100000;
  // How often a system at rest runs, for accelerators that send spontaneously or compute for longer.
  Timeout idle_run = std::chrono::milliseconds(50);
  std::chrono::nanoseconds patience = std::chrono::seconds(2);  // longest wait for the simulator to end
};

class PipeTransport : public Transport {
 public:
  // Start `command`. Throws TransportError.
  explicit PipeTransport(const std::string& command, TransportOptions options = {}, PipeOptions pipe = {})
      : options_(std::move(options)), pipe_(pipe), child_(command, kRequests, kReports), buffer_(kBufferBytes) {
    thread_ = std::thread([this] { run(); });
  }

  ~PipeTransport() override {
    close();
    thread_.join();
  }

  void send(const std::uint8_t* frame, std::size_t size) override {
    Bytes copy(frame, frame + size);
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [this] { return is_over_ || waiting_.size() + requested_ < pipe_.frames_in_flight; });
    throw_if_over();
    waiting_.push_back(std::move(copy));
    is_at_rest_ = false;
    changed_.notify_all();
  }

  // Bursts that arrived before an error are returned before the error is thrown, even if the sender has met it first and
  // closed the transport.
  std::optional<Burst> receive(Timeout timeout = std::nullopt) override {
    std::unique_lock<std::mutex> lock(mutex_);
    const auto is_ready = [this] { return is_over_ || !bursts_.empty(); };
    if (timeout) {
      changed_.wait_until(lock, std::chrono::steady_clock::now() + *timeout, is_ready);
    } else {
      changed_.wait(lock, is_ready);
    }
    if (is_closing_ && !has_failed_) return std::nullopt;
    if (bursts_.empty()) {
      if (is_over_ && !is_closing_) throw_if_over();
      return std::nullopt;
    }
    std::optional<Burst> burst(std::move(bursts_.front()));
    bursts_.pop_front();
    bytes_waiting_ -= burst->data.size();
    changed_.notify_all();
    return burst;
  }

  std::optional<bool> is_at_rest() const override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return is_at_rest_ && waiting_.empty() && bursts_.empty();
  }

  void close() override {
    std::unique_lock<std::mutex> lock(mutex_);
    if (std::exchange(is_closing_, true)) return;
    is_over_ = true;
    changed_.notify_all();
    if (!changed_.wait_for(lock, pipe_.patience, [this] { return has_ended_; })) child_.kill();
  }

 private:
  // The file descriptors that the simulator expects.
  static constexpr int kRequests = 3;
  static constexpr int kReports = 4;
  static constexpr std::size_t kBufferBytes = 1 << 16;
  static constexpr unsigned kVersion = 5;  // of requests and reports
  // The interval at which a simulator at rest is checked, since it may have ended.
  static constexpr std::chrono::nanoseconds kLook = std::chrono::milliseconds(250);
  static constexpr std::uint32_t kFewestCycles = 64, kMostCycles = 1 << 20;  // of a run
  static constexpr std::uint64_t kPausesToRest = 4;

  void throw_if_over() const {
    if (is_closing_) throw TransportError("the transport is closed");
    if (is_over_) throw TransportError(error_);
  }

  // --- the thread -----------------------------------------------------------------------------------------------------

  void run() {
    const SigpipeHeld held;
    std::string error;
    try {
      while (wait_for_work()) {
        const auto begun = std::chrono::steady_clock::now();
        const std::uint64_t before = cycle_;
        if (!request()) fail_with_child();
        if (place_ == 0) check_version();
        for (std::size_t run = 0; run < runs_; ++run) {
          while (take_report()) {
          }
        }
        adapt(cycle_ - before, std::chrono::steady_clock::now() - begun);
      }
      const std::uint8_t quit = 'Q';
      child_.write(&quit, 1);
      child_.end_input();
      child_.wait(pipe_.patience);
    } catch (const std::exception& fault) {
      error = fault.what();
      child_.kill();
      child_.wait();
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    error_ = error;
    has_failed_ = !error.empty() && !is_closing_;
    is_over_ = true;
    has_ended_ = true;
    changed_.notify_all();
  }

  // Sleep until the simulator should run; false when the transport is closed.
  bool wait_for_work() {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [this] { return is_closing_ || bytes_waiting_ < pipe_.bytes_waiting; });
    const auto has_work = [this] { return is_closing_ || !is_at_rest_; };
    const Deadline idle(pipe_.idle_run);
    const auto look = std::min(kLook, pipe_.idle_run.value_or(kLook));
    while (!changed_.wait_for(lock, look, has_work) && !idle.is_over() && !child_.has_closed()) {
    }
    return !is_closing_;
  }

  // Hand over all frames and let the simulator run; false if it no longer reads.
  bool request() {
    std::deque<Bytes> frames;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      frames.swap(waiting_);
      requested_ += frames.size();
    }
    if (!frames.empty()) busy_ = cycle_;
    for (const auto& frame : frames) {
      const auto header = with_number('F', static_cast<std::uint32_t>(frame.size()));
      if (!child_.write(header.data(), header.size()) || !child_.write(frame.data(), frame.size())) return false;
    }
    // A run ends when a frame is taken. Waiting for this process then would take longer than the simulation.
    runs_ = frames.size() + 1;
    const auto run = with_number('R', frames.empty() ? quiet_step_ : step_);
    Bytes all;
    for (std::size_t number = 0; number < runs_; ++number) all.insert(all.end(), run.begin(), run.end());
    return child_.write(all.data(), all.size());
  }

  // Choose the cycles of the next runs, after one of `cycles` that took `time`: as many as take the set time, but few
  // after a burst, whose receivers need the processor more than possibly idle hardware.
  void adapt(std::uint64_t cycles, std::chrono::nanoseconds time) {
    if (runs_ == 1 && time > 2 * pipe_.run_time) {
      step_ = std::max(step_ / 2, kFewestCycles);
    } else if (cycles == runs_ * step_ && time < pipe_.run_time / 2) {
      step_ = std::min(2 * step_, kMostCycles);
    }
    quiet_step_ = std::exchange(has_burst_, false) ? kFewestCycles : std::min(2 * quiet_step_, step_);
  }

  static Bytes with_number(char letter, std::uint32_t number) {
    Bytes bytes{static_cast<std::uint8_t>(letter)};
    for (unsigned shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<std::uint8_t>(number >> shift));
    return bytes;
  }

  void check_version() {
    const auto letter = static_cast<unsigned>(number(1)), version = static_cast<unsigned>(number(1));
    if (letter == 'V' && version == kVersion) return;
    char text[128];
    std::snprintf(text, sizeof text, "the simulator sent 0x%02x%02x instead of version %u of its reports; build it again",
                  letter, version, kVersion);
    throw TransportError(text);
  }

  // Take a report; return whether more follow.
  bool take_report() {
    const std::uint64_t place = place_;
    const auto letter = static_cast<std::uint8_t>(number(1));
    switch (letter) {
      case 'T':
        take_taken();
        return true;
      case 'B':
        take_burst();
        return true;
      case 'E':
        take_error();
        return true;
      case 'I':
        take_id_error();
        return true;
      case 'S':
        take_standing();
        return false;
      default:
        break;
    }
    char text[128];
    std::snprintf(text, sizeof text, "byte %llu of the simulator's reports is 0x%02x; legal at the start of a report: T, B, E, I, S",
                  static_cast<unsigned long long>(place), letter);
    throw TransportError(text);
  }

  void take_taken() {
    const Cycles cycles = this->cycles();
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (requested_ == 0) throw TransportError("the simulator reports a frame that was not sent to it");
      --requested_;
      changed_.notify_all();
    }
    if (options_.on_taken) options_.on_taken(cycles);
  }

  void take_burst() {
    has_burst_ = true;
    Burst burst;
    burst.tid = static_cast<unsigned>(number(2));
    burst.is_aborted = number(1) != 0;
    burst.cycles = cycles();
    const std::uint64_t size = number(4);
    // A resumed burst has one more beat than its part of the frame.
    if (size == 0 || size > options_.longest_payload + kFrameHeaderBytes + kWidestBeat) {
      throw TransportError("the simulator reports a burst of " + std::to_string(size) + " bytes; legal: 1 to " +
                           std::to_string(options_.longest_payload + kFrameHeaderBytes + kWidestBeat));
    }
    burst.data.resize(static_cast<std::size_t>(size));
    take(burst.data.data(), burst.data.size());
    const std::lock_guard<std::mutex> lock(mutex_);
    bytes_waiting_ += burst.data.size();
    bursts_.push_back(std::move(burst));
    changed_.notify_all();
  }

  void take_error() {
    HardwareError error;
    error.converter = static_cast<unsigned>(number(2));
    error.code = static_cast<unsigned>(number(1));
    error.cycle = number(8);
    if (options_.on_error) options_.on_error(error);
  }

  void take_id_error() {
    HardwareError error;
    error.cycle = number(8);
    if (options_.on_error) options_.on_error(error);
  }

  void take_standing() {
    const std::uint64_t cycle = number(8), quiet = number(4);
    if (cycle < cycle_) {
      throw TransportError("the simulator reports cycle " + std::to_string(cycle) + " after cycle " +
                           std::to_string(cycle_));
    }
    // A beat without a new frame ends a pause of the system itself.
    const std::uint64_t ran = cycle - cycle_;
    if (quiet < ran && busy_ != cycle_) longest_pause_ = std::max(longest_pause_, quiet_ + ran - quiet);
    quiet_ = quiet;
    cycle_ = cycle;
    const auto most = std::max(pipe_.cycles_to_rest, pipe_.most_cycles_to_rest);
    const auto to_rest = std::clamp<std::uint64_t>(kPausesToRest * longest_pause_, pipe_.cycles_to_rest, most);
    const std::lock_guard<std::mutex> lock(mutex_);
    // A frame that the system has not taken for this time does not keep the simulation running.
    is_at_rest_ = std::min(quiet, cycle - busy_) >= to_rest && waiting_.empty();
    changed_.notify_all();
  }

  Cycles cycles() {
    const std::uint64_t first = number(8), last = number(8);
    if (last < first) {
      throw TransportError("the simulator reports beats from cycle " + std::to_string(first) + " to " +
                           std::to_string(last));
    }
    return {first, last};
  }

  std::uint64_t number(std::size_t bytes) {
    std::uint8_t digits[8];
    take(digits, bytes);
    std::uint64_t value = 0;
    for (std::size_t place = bytes; place > 0; --place) value = value << 8 | digits[place - 1];
    return value;
  }

  // Read `size` bytes of the reports.
  void take(std::uint8_t* bytes, std::size_t size) {
    while (size > 0) {
      if (read_ == filled_) {
        read_ = 0;
        filled_ = child_.read(buffer_.data(), buffer_.size());
        if (filled_ == 0) fail_with_child();
      }
      const std::size_t count = std::min(size, filled_ - read_);
      std::copy_n(buffer_.begin() + static_cast<std::ptrdiff_t>(read_), count, bytes);
      read_ += count;
      place_ += count;
      bytes += count;
      size -= count;
    }
  }

  [[noreturn]] void fail_with_child() { throw TransportError("the simulator " + child_.wait(pipe_.patience)); }

  static constexpr std::size_t kWidestBeat = 64;  // bytes

  const TransportOptions options_;
  const PipeOptions pipe_;

  // Used by the thread only.
  ChildProcess child_;
  Bytes buffer_;
  std::size_t read_ = 0;
  std::size_t filled_ = 0;
  std::uint64_t place_ = 0;  // number of report bytes so far
  std::uint64_t cycle_ = 0;  // current cycle of the simulator
  std::uint64_t busy_ = 0;   // cycle at which it last got a frame
  std::uint64_t quiet_ = 0;  // cycles without a beat, up to the current one
  std::uint64_t longest_pause_ = 0;
  std::size_t runs_ = 1;     // that were asked for together
  bool has_burst_ = false;   // in one of them
  std::uint32_t step_ = kFewestCycles;        // cycles of a run
  std::uint32_t quiet_step_ = kFewestCycles;  // the same without new frames

  mutable std::mutex mutex_;  // protects the members below
  std::condition_variable changed_;
  std::deque<Bytes> waiting_;
  std::size_t requested_ = 0;  // frames handed to the simulator, but not yet taken by the system
  std::deque<Burst> bursts_;
  std::size_t bytes_waiting_ = 0;
  bool is_at_rest_ = false;
  bool is_closing_ = false;
  bool is_over_ = false;
  bool has_failed_ = false;  // before it was closed
  bool has_ended_ = false;
  std::string error_;

  std::thread thread_;
};

}  // namespace firm
