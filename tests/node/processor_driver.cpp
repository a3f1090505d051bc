// A node in C++ on a processor with AXI DMA, before the model in dma_engine.py: `ROOT COUNT LONGEST SEED RESTARTS`.
//
// COUNT random messages of 1 to LONGEST bytes, short and long ones alike, go out and come back, through the registers,
// the interrupt and the memory of the board below ROOT. Prints a line for each fault that the node tells, then `sent S
// published P lost L silently Q`: lost are the messages that did not come back, silently those for which no fault was told.
#include <firm/node.hpp>

#include <cmath>
#include <cstdlib>
#include <iostream>
#include <random>
#include <thread>

#include "engine_registers.hpp"

namespace {

// The messages by their number: any thread makes them.
class Messages {
 public:
  Messages(unsigned seed, std::size_t longest) : seed_(seed), longest_(longest) {}

  std::size_t size(unsigned number) const {
    std::minstd_rand source(seed_ + 7919 * number);
    source.discard(3);
    const double part = static_cast<double>(source()) / static_cast<double>(std::minstd_rand::max());
    const double exponent = std::log2(static_cast<double>(longest_)) * part;
    return number == 0 ? longest_ : static_cast<std::size_t>(std::exp2(exponent));
  }

  firm::Bytes operator[](unsigned number) const {
    firm::Bytes payload(size(number));
    // One word and its place: as different as random bytes, and much faster.
    const std::uint32_t word = (seed_ + number) * 2654435761U;
    for (std::size_t place = 0; place < payload.size(); ++place) {
      payload[place] = static_cast<std::uint8_t>((word >> place % 4 * 8) + place / 251);
    }
    return payload;
  }

 private:
  unsigned seed_;
  std::size_t longest_;
};

// What comes back: messages in their order; those that are passed over are lost.
struct Answers {
  const Messages& messages;
  unsigned count;
  unsigned next = 0, published = 0, lost = 0, silently = 0;
  std::uint64_t faults = 0;  // told when the last message came

  void take(const firm::Bytes& payload, std::uint64_t faults_now) {
    unsigned found = next;
    while (found < count && (messages.size(found) != payload.size() || messages[found] != payload)) ++found;
    if (found == count) {
      std::cout << "a message that nobody sent, of " << payload.size() << " bytes\n";
      std::exit(1);
    }
    pass_over(found, faults_now);
    next = found + 1;
    ++published;
  }

  void pass_over(unsigned until, std::uint64_t faults_now) {
    lost += until - next;
    if (faults_now == faults) silently += until - next;
    faults = faults_now;
  }
};

}  // namespace

int main(int, char** words) {
  const std::string root = words[1];
  const unsigned count = static_cast<unsigned>(std::stoul(words[2]));
  const std::size_t longest = std::stoul(words[3]);
  const Messages messages(static_cast<unsigned>(std::stoul(words[4])), longest);
  firm::NodeConfiguration system;
  system.longest_payload = longest;
  system.overflow = firm::Overflow::kBlock;
  system.restarts = static_cast<unsigned>(std::stoul(words[5]));
  system.restart_delay = std::chrono::milliseconds(10);
  system.settling_time = std::chrono::seconds(2);
  system.log = [](firm::Level, const std::string& line) { std::cout << line << std::endl; };
  Answers answers{messages, count};
  firm::Node* running = nullptr;
  firm::Node node(
      system,
      [&](const firm::TransportOptions& options) {
        auto device = std::make_unique<firm::LinuxDmaDevice>("/dev/uio0", "udmabuf0", true, root, engine_registers(root));
        return std::make_unique<firm::DmaTransport>(std::move(device), options);
      },
      [&](unsigned, const std::uint8_t* payload, std::size_t size) {
        answers.take(firm::Bytes(payload, payload + size), running->statistics().restarts);
      });
  running = &node;
  int status = 1;
  std::thread engine([&] { status = node.run(); });
  for (unsigned number = 0; number < count; ++number) {
    const firm::Bytes payload = messages[number];
    node.put(0, payload.data(), payload.size());
  }
  node.stop(std::chrono::seconds(60));
  engine.join();
  answers.pass_over(count, node.statistics().restarts);
  std::cout << "sent " << node.statistics().sent << " published " << answers.published << " lost " << answers.lost
            << " silently " << answers.silently << std::endl;
  return status;
}
