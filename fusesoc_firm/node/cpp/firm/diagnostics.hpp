// SPDX-License-Identifier: Apache-2.0
// A node's counts as a diagnostic_msgs/DiagnosticArray, serialised for ROS 1 or ROS 2 (XCDR1). C++17.
//
//     firm::Diagnosis diagnosis(ros, topic);
//     while (running) diagnosis.tell([&] { return std::vector{firm::report_of("robot: node", node)}; });
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <firm/action.hpp>
#include <firm/log.hpp>
#include <firm/node.hpp>
#include <firm/services.hpp>
#include <firm/topic.hpp>

namespace firm {

// The state of a part of the system, by its name: the counts, their faults, and whether these have increased.
struct Report {
  std::string name;
  std::vector<std::pair<std::string, std::uint64_t>> counts{};
  std::uint64_t troubles = 0;
  bool is_warning = false;
};

class Diagnostics {
 public:
  // `version` is that of ROS: 1 or 2.
  explicit Diagnostics(unsigned version) : is_first_(version == 1) {}

  // Return the serialised message, valid until the next call.
  const std::vector<std::uint8_t>& message(const Report& report, std::chrono::system_clock::time_point time) {
    const auto since = std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch()).count();
    constexpr std::int64_t kSecond = 1'000'000'000;
    bytes_.clear();
    if (is_first_) {
      number(0);  // the header's count, which only the publisher's library would know
    } else {
      bytes_ = {0, 1, 0, 0};
    }
    number(static_cast<std::uint32_t>(since / kSecond));
    number(static_cast<std::uint32_t>(since % kSecond));
    text("");
    number(1);  // one status
    bytes_.push_back(report.is_warning ? 1 : 0);
    text(report.name);
    text(report.is_warning ? "messages were lost or rejected" : "OK");
    text("");
    number(static_cast<std::uint32_t>(report.counts.size()));
    for (const auto& [key, count] : report.counts) {
      text(key);
      text(std::to_string(count));
    }
    return bytes_;
  }

 private:
  void number(std::uint32_t value) {
    // ROS 2 aligns numbers; its first four bytes name the encoding, so alignment may count from any of them.
    while (!is_first_ && bytes_.size() % 4 != 0) bytes_.push_back(0);
    for (unsigned shift = 0; shift < 32; shift += 8) bytes_.push_back(static_cast<std::uint8_t>(value >> shift));
  }

  // ROS 2 counts and sends the NUL.
  void text(const std::string& value) {
    number(static_cast<std::uint32_t>(value.size() + (is_first_ ? 0 : 1)));
    bytes_.insert(bytes_.end(), value.begin(), value.end());
    if (!is_first_) bytes_.push_back(0);
  }

  const bool is_first_;
  std::vector<std::uint8_t> bytes_;
};

// Return the counts of an engine; `lost` messages were published, but ROS did not deliver them.
inline Report report_of(const std::string& name, const Node& node, std::uint64_t lost = 0) {
  const NodeStatistics counted = node.statistics();
  return {name,
          {{"received", counted.received},
           {"dropped", counted.dropped},
           {"sent", counted.sent},
           {"published", counted.published},
           {"errors", counted.errors},
           {"restarts", counted.restarts},
           {"lost", lost}},
          counted.dropped + counted.errors + counted.restarts + lost};
}

// Add the counts of a service to a report, by the name of its block.
inline void add_counts(Report& report, const std::string& block, const CallStatistics& counted) {
  report.counts.insert(report.counts.end(), {{block + " called", counted.called},
                                             {block + " answered", counted.answered},
                                             {block + " failed", counted.failed},
                                             {block + " unasked", counted.unasked}});
  report.troubles += counted.failed + counted.unasked;
}

// Add the counts of an action to a report, by the name of its block.
inline void add_counts(Report& report, const std::string& block, const GoalStatistics& counted) {
  report.counts.insert(report.counts.end(), {{block + " goals", counted.goals},
                                             {block + " succeeded", counted.succeeded},
                                             {block + " canceled", counted.canceled},
                                             {block + " aborted", counted.aborted},
                                             {block + " rejected", counted.rejected},
                                             {block + " unasked", counted.unasked},
                                             {block + " lost", counted.lost}});
  report.troubles += counted.aborted + counted.rejected + counted.unasked + counted.lost;
}

// Publishes reports each second, with a warning if a count of faults has increased.
class Diagnosis {
 public:
  // A node without the message's package runs without this topic.
  template <typename Ros>
  Diagnosis(Ros& ros, const Topic& topic) : writer_(Ros::kVersion) {
    try {
      publish_ = ros.advertise(topic, topic.quality);
    } catch (const MiddlewareError& error) {
      node_log().say(Level::kWarning, topic.name + " is not published: " + error.what());
    }
  }

  // Publish what `make_reports` returns if a second has passed since its last call.
  template <typename MakeReports>
  void tell(MakeReports make_reports) {
    const auto now = std::chrono::steady_clock::now();
    if (!publish_ || now < next_) return;
    next_ = now + std::chrono::seconds(1);
    for (Report& report : make_reports()) {
      std::uint64_t& before = troubles_[report.name];
      report.is_warning = report.troubles > before;
      before = report.troubles;
      const auto& message = writer_.message(report, std::chrono::system_clock::now());
      publish_(message.data(), message.size());
    }
  }

 private:
  Diagnostics writer_;
  MessageHandler publish_;
  std::chrono::steady_clock::time_point next_{};
  std::map<std::string, std::uint64_t> troubles_;
};

}  // namespace firm
