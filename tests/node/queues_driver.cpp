// Speaks for firm/queues.hpp. `queues POLICY OVERFLOW CAPACITY SUBSCRIBERS DEADLINE... TRANSFER...`, then a line for each
// `put SUBSCRIBER TIME`, `get` and `close`; each line of input gives one of output. An item is its number.
// `shared OVERFLOW CAPACITY` makes queues of three subscribers; number 1 shares the queue of number 0, and has no limit.
// With an argument, threads write and read instead: every item must come once, and in order.
#include <firm/queues.hpp>

#include <iostream>
#include <sstream>
#include <thread>

using Queues = firm::SubscriberQueues<int>;

static std::int64_t now = 0;

static firm::Overflow overflow_of(const std::string& word) {
  return word == "drop_oldest"   ? firm::Overflow::kDropOldest
         : word == "drop_newest" ? firm::Overflow::kDropNewest
                                 : firm::Overflow::kBlock;
}

static std::unique_ptr<Queues> make_shared(std::istringstream& words) {
  std::string overflow;
  std::size_t capacity;
  words >> overflow >> capacity;
  const std::vector<std::size_t> capacities{capacity, firm::kUnlimitedDepth, capacity};
  auto queues = std::make_unique<Queues>(capacities, nullptr, overflow_of(overflow), [] { return now; });
  queues->share(1, 0);
  return queues;
}

static std::unique_ptr<Queues> make(std::istringstream& words) {
  std::string policy, overflow;
  std::size_t capacity, subscribers;
  words >> policy >> overflow >> capacity >> subscribers;
  std::vector<std::int64_t> deadlines(subscribers), transfers(subscribers);
  for (auto& value : deadlines) words >> value;
  for (auto& value : transfers) words >> value;
  std::unique_ptr<firm::Policy> chosen;  // none: least recently used
  if (policy == "fixed_priority") chosen = std::make_unique<firm::FixedPriority>();
  if (policy == "round_robin") chosen = std::make_unique<firm::RoundRobin>(subscribers);
  if (policy == "edf") chosen = std::make_unique<firm::EarliestDeadlineFirst>(deadlines);
  if (policy == "lst") chosen = std::make_unique<firm::LeastSlackTime>(deadlines, transfers);
  return std::make_unique<Queues>(subscribers, capacity, std::move(chosen), overflow_of(overflow), [] { return now; });
}

static void answer(Queues& queues, std::istringstream& words, const std::string& command, int number) {
  if (command == "put") {
    std::size_t subscriber;
    words >> subscriber >> now;
    const bool kept = queues.put(subscriber, number, std::chrono::nanoseconds(0));
    std::cout << (kept ? "kept " : "refused ") << queues.dropped(subscriber) << "\n";
  } else if (command == "get") {
    if (const auto next = queues.get(std::chrono::nanoseconds(0))) {
      std::cout << next->subscriber << " " << next->item << "\n";
    } else {
      std::cout << (queues.is_drained() ? "closed" : "empty") << "\n";
    }
  } else {
    queues.close();
    std::cout << "closed\n";
  }
}

static int threads() {
  constexpr std::size_t kSubscribers = 4;
  constexpr int kItems = 5000;
  Queues queues(kSubscribers, 3, nullptr, firm::Overflow::kBlock);
  std::vector<std::thread> writers;
  for (std::size_t subscriber = 0; subscriber < kSubscribers; ++subscriber) {
    writers.emplace_back([&queues, subscriber] {
      for (int item = 0; item < kItems; ++item) queues.put(subscriber, item);
    });
  }
  std::vector<int> expected(kSubscribers, 0);
  bool in_order = true;
  std::thread reader([&] {
    while (const auto next = queues.get()) in_order = in_order && next->item == expected[next->subscriber]++;
  });
  for (auto& writer : writers) writer.join();
  bool is_refused = false;
  queues.close();
  reader.join();
  try {
    queues.put(0, 0);
  } catch (const firm::ClosedError&) {
    is_refused = true;
  }
  for (const int count : expected) in_order = in_order && count == kItems;
  // A writer that waits for room is told of the end.
  Queues full(1, 1, nullptr, firm::Overflow::kBlock);
  full.put(0, 1);
  bool is_told = false;
  std::thread waiting([&] {
    try {
      full.put(0, 2);
    } catch (const firm::ClosedError&) {
      is_told = true;
    }
  });
  full.close();
  waiting.join();
  const bool is_kept = full.get()->item == 1 && !full.get() && full.is_drained();
  return in_order && is_refused && is_told && is_kept ? 0 : 1;
}

int main(int count, char**) {
  if (count > 1) return threads();
  std::unique_ptr<Queues> queues;
  std::string line, command;
  for (int number = 0; std::getline(std::cin, line); ++number) {
    std::istringstream words(line);
    words >> command;
    try {
      if (command == "queues" || command == "shared") {
        queues = command == "queues" ? make(words) : make_shared(words);
        std::cout << "ready\n";
      } else {
        answer(*queues, words, command, number);
      }
    } catch (const firm::ClosedError&) {
      std::cout << "closed\n";
    }
  }
}
