// SPDX-License-Identifier: Apache-2.0
// Reads the status of hardware each second for a limited time, so that a slow link stays free for messages. The
// counterpart in Python is `StatusWatch` of fusesoc_firm/node/status/status.py. C++17.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <firm/diagnostics.hpp>
#include <firm/faults.hpp>
#include <firm/status.hpp>
#include <firm/transport.hpp>

namespace firm {

class StatusWatch {
 public:
  // Returns the word of the register at an address. Throws TransportError.
  using Read = std::function<std::uint32_t(std::uint32_t)>;

  // `channels` are the names of the channels, the subscribers first.
  StatusWatch(Read read, const std::vector<std::string>& channels)
      : read_(std::move(read)), registers_(registers(channels)), thread_([this] { run(); }) {}

  ~StatusWatch() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      is_ending_ = true;
      changed_.notify_all();
    }
    thread_.join();
  }
  StatusWatch(const StatusWatch&) = delete;
  StatusWatch& operator=(const StatusWatch&) = delete;

  // Return the values read so far, without faults that are zero.
  Report report(const std::string& name) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    Report report{name};
    for (const auto& item : registers_) {
      const auto word = words_.find(item.address);
      if (word == words_.end()) continue;
      if (item.is_trouble) report.troubles += word->second;
      if (word->second > 0 || !item.is_fault) report.counts.emplace_back(item.text, word->second);
    }
    report.troubles += unanswered_;
    report.counts.emplace_back("accesses without an answer", unanswered_);
    return report;
  }

 private:
  struct Register {
    std::uint32_t address;
    std::string text;
    bool is_trouble = false;  // its count is one of faults
    bool is_fault = false;    // of a channel, with a code
  };
  static constexpr std::chrono::seconds kInterval{1};
  static constexpr std::chrono::milliseconds kReading{50};

  static std::vector<Register> registers(const std::vector<std::string>& channels) {
    namespace at = status_register;
    std::vector<Register> found{{at::kIdErrors, "unknown ids", true},
                                {at::kLinkErrors, "link errors", true},
                                {at::kLost, "uncounted faults", true}};
    std::uint32_t base = at::kChannels;
    for (const auto& name : channels) {
      found.push_back({base + at::kFrames, name + " frames"});
      found.push_back({base + at::kLongestWait, name + " longest wait in cycles"});
      for (std::uint32_t code = 1; code <= kFaultCodes; ++code) {
        found.push_back({base + 4 * code, name + ": " + kFaultTexts[code], true, true});
      }
      base += at::kChannelBytes;
    }
    return found;
  }

  void run() {
    std::unique_lock<std::mutex> lock(mutex_);
    while (!changed_.wait_for(lock, kInterval, [this] { return is_ending_; })) {
      lock.unlock();
      advance();
      lock.lock();
    }
  }

  // Read the next registers: at least one, and at most each register once.
  void advance() {
    const auto end = std::chrono::steady_clock::now() + kReading;
    for (std::size_t count = 0; count < registers_.size(); ++count) {
      const std::uint32_t address = registers_[next_].address;
      try {
        const std::uint32_t word = read_(address);
        const std::lock_guard<std::mutex> lock(mutex_);
        words_[address] = word;
      } catch (const TransportError&) {
        const std::lock_guard<std::mutex> lock(mutex_);
        ++unanswered_;
        return;
      }
      next_ = (next_ + 1) % registers_.size();
      if (std::chrono::steady_clock::now() >= end) return;
    }
  }

  const Read read_;
  const std::vector<Register> registers_;
  std::size_t next_ = 0;  // used by the thread only

  mutable std::mutex mutex_;  // protects the members below
  std::condition_variable changed_;
  std::map<std::uint32_t, std::uint32_t> words_;
  std::uint64_t unanswered_ = 0;
  bool is_ending_ = false;

  std::thread thread_;
};

}  // namespace firm
