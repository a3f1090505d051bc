// SPDX-License-Identifier: Apache-2.0
// Frames to the hardware: a queue for each subscriber, and a policy that chooses the next one (the dissertation's
// section 6.3.3, figure 6.4b; docs/reference/host-queues.md).
//
//     firm::SubscriberQueues<Frame> queues(3, 10);         // subscribers, frames in each; least recently used
//     queues.put(subscriber, frame);                       // any thread, such as a callback of the middleware
//     while (auto next = queues.get()) send(next->item);   // the thread that owns the DMA, until close()
//
// The behaviour equals that of fusesoc_firm/node/engine/queues.py; both are tested with the same histories. C++17, no
// dependencies.
#pragma once

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace firm {

// The rule that chooses the next subscriber: the smallest key wins; among equal keys, the lowest index wins.
class Policy {
 public:
  virtual ~Policy() = default;
  // Return the key of a subscriber whose first queued frame arrived at `arrival` (in ns).
  virtual std::int64_t key(std::size_t subscriber, std::int64_t arrival) const = 0;
  // Record that a frame of this subscriber was read from its queue.
  virtual void served(std::size_t) {}
};

// A policy that serves the lowest index first.
class FixedPriority : public Policy {
 public:
  std::int64_t key(std::size_t subscriber, std::int64_t) const override {
    return static_cast<std::int64_t>(subscriber);
  }
};

// A policy that serves the indices in turn, beginning with index 0.
class RoundRobin : public Policy {
 public:
  explicit RoundRobin(std::size_t subscribers) : subscribers_(subscribers) {}
  std::int64_t key(std::size_t subscriber, std::int64_t) const override {
    return static_cast<std::int64_t>((subscriber + subscribers_ - first_) % subscribers_);
  }
  void served(std::size_t subscriber) override { first_ = (subscriber + 1) % subscribers_; }

 private:
  std::size_t subscribers_;
  std::size_t first_ = 0;
};

// A policy that serves the subscriber served least recently (section 4.2.1); at first, the lowest index. A subscriber
// waits for at most `subscribers` - 1 others.
class LeastRecentlyUsed : public Policy {
 public:
  explicit LeastRecentlyUsed(std::size_t subscribers) : served_at_(subscribers, -1) {}
  std::int64_t key(std::size_t subscriber, std::int64_t) const override { return served_at_[subscriber]; }
  void served(std::size_t subscriber) override { served_at_[subscriber] = now_++; }

 private:
  std::vector<std::int64_t> served_at_;
  std::int64_t now_ = 0;
};

// A policy that serves the frame with the earliest deadline: its arrival time plus a relative deadline (in ns).
class EarliestDeadlineFirst : public Policy {
 public:
  explicit EarliestDeadlineFirst(std::vector<std::int64_t> deadlines) : deadlines_(std::move(deadlines)) {}
  std::int64_t key(std::size_t subscriber, std::int64_t arrival) const override {
    return arrival + deadlines_.at(subscriber);
  }

 private:
  std::vector<std::int64_t> deadlines_;
};

// A policy that serves the frame with the least slack: the time until its deadline minus its transfer time (in ns). The
// key is the latest start time, which orders subscribers like their slack, since all share the current time.
class LeastSlackTime : public Policy {
 public:
  LeastSlackTime(std::vector<std::int64_t> deadlines, const std::vector<std::int64_t>& transfer_times)
      : latest_starts_(std::move(deadlines)) {
    if (latest_starts_.size() != transfer_times.size()) {
      throw std::invalid_argument("the numbers of transfer times and deadlines differ");
    }
    for (std::size_t index = 0; index < transfer_times.size(); ++index) latest_starts_[index] -= transfer_times[index];
  }
  std::int64_t key(std::size_t subscriber, std::int64_t arrival) const override {
    return arrival + latest_starts_.at(subscriber);
  }

 private:
  std::vector<std::int64_t> latest_starts_;
};

// The action of put() when a queue is full: drop the queue's oldest frame like KEEP_LAST in ROS, drop the new frame, or
// wait for space.
enum class Overflow { kDropOldest, kDropNewest, kBlock };

// The capacity of a subscriber whose frames are never dropped.
constexpr std::size_t kUnlimitedDepth = std::numeric_limits<std::size_t>::max();

// The queues are closed.
class ClosedError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

inline std::int64_t steady_nanoseconds() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

// Bounded queues, one for each subscriber, that are read like one queue. Any number of threads may read and write.
template <typename Item>
class SubscriberQueues {
 public:
  struct Next {
    std::size_t subscriber;
    Item item;
  };
  using Timeout = std::optional<std::chrono::nanoseconds>;  // nothing: no limit
  using Clock = std::function<std::int64_t()>;              // ns

  // Each queue holds `capacity` frames; without a policy, it is least recently used. Throws std::invalid_argument.
  SubscriberQueues(std::size_t subscribers, std::size_t capacity, std::unique_ptr<Policy> policy = nullptr,
                   Overflow overflow = Overflow::kDropOldest, Clock clock = steady_nanoseconds)
      : SubscriberQueues(std::vector<std::size_t>(subscribers, capacity), std::move(policy), overflow,
                         std::move(clock)) {}

  // Each subscriber has a capacity; kUnlimitedDepth: no limit.
  explicit SubscriberQueues(std::vector<std::size_t> capacities, std::unique_ptr<Policy> policy = nullptr,
                            Overflow overflow = Overflow::kDropOldest, Clock clock = steady_nanoseconds)
      : policy_(policy ? std::move(policy) : std::make_unique<LeastRecentlyUsed>(capacities.size())),
        capacities_(std::move(capacities)),
        overflow_(overflow),
        clock_(std::move(clock)),
        queues_(capacities_.size()),
        waiting_(capacities_.size(), 0),
        dropped_(capacities_.size(), 0) {
    const auto least = std::min_element(capacities_.begin(), capacities_.end());
    if (least == capacities_.end() || *least < 1) {
      throw std::invalid_argument("subscribers is " + std::to_string(capacities_.size()) + ", capacity is " +
                                  (least == capacities_.end() ? "none" : std::to_string(*least)) + "; legal: 1 or more");
    }
  }

  // Let a subscriber's items wait in the queue of another one, so that they are read in the order of both. Each of them
  // keeps its own capacity. This is called before the first item.
  void share(std::size_t subscriber, std::size_t other) { shared_[subscriber] = other; }

  // Add an item; return whether it is queued. The item is not queued if a full queue drops the newest item, or stays
  // full until the timeout. Throws ClosedError, even during the wait, and std::out_of_range for an unknown subscriber.
  bool put(std::size_t subscriber, Item item, Timeout timeout = std::nullopt) {
    auto& queue = queues_.at(queue_of(subscriber));
    std::unique_lock<std::mutex> lock(mutex_);
    if (overflow_ == Overflow::kBlock) {
      wait_for(lock, timeout, [&] { return closed_ || waiting_[subscriber] < capacities_[subscriber]; });
    }
    if (closed_) throw ClosedError("the queues are closed");
    if (waiting_[subscriber] == capacities_[subscriber]) {
      if (overflow_ != Overflow::kBlock) ++dropped_[subscriber];
      if (overflow_ != Overflow::kDropOldest) return false;
      queue.erase(std::find_if(queue.begin(), queue.end(),
                               [&](const Waiting& waiting) { return waiting.subscriber == subscriber; }));
      --waiting_[subscriber];
    }
    queue.push_back({clock_(), subscriber, std::move(item)});
    ++waiting_[subscriber];
    changed_.notify_all();
    return true;
  }

  // Return the next subscriber and its first item. Returns nothing on timeout, or when the queues are closed and empty;
  // is_drained() distinguishes the two.
  std::optional<Next> get(Timeout timeout = std::nullopt) {
    std::unique_lock<std::mutex> lock(mutex_);
    wait_for(lock, timeout, [&] { return closed_ || first_waiting().has_value(); });
    const auto served = first_waiting();
    if (!served) return std::nullopt;
    auto& queue = queues_[*served];
    std::optional<Next> next(Next{queue.front().subscriber, std::move(queue.front().item)});
    queue.pop_front();
    --waiting_[next->subscriber];
    policy_->served(*served);
    changed_.notify_all();
    return next;
  }

  // Accept no more items, and wake all waiting threads; queued items can still be read.
  void close() {
    const std::lock_guard<std::mutex> lock(mutex_);
    closed_ = true;
    changed_.notify_all();
  }

  // Return whether the queues are closed and empty.
  bool is_drained() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return closed_ && !first_waiting();
  }

  // Return the number of a subscriber's items that were dropped.
  std::uint64_t dropped(std::size_t subscriber) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return dropped_.at(subscriber);
  }

 private:
  struct Waiting {
    std::int64_t arrival;
    std::size_t subscriber;
    Item item;
  };

  std::size_t queue_of(std::size_t subscriber) const {
    const auto found = shared_.find(subscriber);
    return found == shared_.end() ? subscriber : found->second;
  }

  template <typename Condition>
  void wait_for(std::unique_lock<std::mutex>& lock, Timeout timeout, Condition condition) {
    if (timeout) {
      changed_.wait_until(lock, std::chrono::steady_clock::now() + *timeout, condition);
    } else {
      changed_.wait(lock, condition);
    }
  }

  std::optional<std::size_t> first_waiting() const {
    std::optional<std::size_t> best;
    std::int64_t best_key = 0;
    for (std::size_t index = 0; index < queues_.size(); ++index) {
      if (queues_[index].empty()) continue;
      const std::int64_t key = policy_->key(index, queues_[index].front().arrival);
      if (!best || key < best_key) {
        best = index;
        best_key = key;
      }
    }
    return best;
  }

  std::unique_ptr<Policy> policy_;
  std::vector<std::size_t> capacities_;
  Overflow overflow_;
  Clock clock_;
  std::map<std::size_t, std::size_t> shared_;  // the queues of those that share one
  std::vector<std::deque<Waiting>> queues_;
  std::vector<std::size_t> waiting_;  // items of each subscriber
  std::vector<std::uint64_t> dropped_;
  bool closed_ = false;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
};

}  // namespace firm
