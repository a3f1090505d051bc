// firm/dma_transport.hpp before a model of AXI DMA (PG021: scatter and gather) whose stream comes back as it goes.
//
// `node ADDRESSES...`-like words: COUNT LONGEST BUFFER_BYTES SEED FAULT AT. Random frames are sent by one thread and must
// come back to another; the model watches the rules of descriptors. FAULT is one of those in FakeDma, for frame AT.
// `files ROOT` opens a device made of files below ROOT instead. Output is one line: `ok BYTES SECONDS`, or `error: ...`.
#include <firm/dma_transport.hpp>

#include <condition_variable>
#include <deque>
#include <iostream>
#include <random>
#include <thread>

// The engine: its registers, and a thread that works off descriptors.
class FakeDma : public firm::DmaDevice {
 public:
  FakeDma(std::size_t memory_bytes, std::string fault, unsigned at)
      : memory_(memory_bytes), fault_(std::move(fault)), at_(at), thread_([this] { work(); }) {}
  ~FakeDma() override {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      is_over_ = true;
      changed_.notify_all();
    }
    thread_.join();
  }

  std::uint32_t read(std::size_t offset) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    const Channel& channel = channels_[offset >= 0x30];
    const std::size_t place = offset % 0x30;
    if (place == 0x00) return channel.control;
    if (place == 0x04) return channel.status | (fault_ == "simple" ? 0 : 1U << 3);
    return fail("a register that is not read: " + std::to_string(offset)), 0;
  }

  void write(std::size_t offset, std::uint32_t value) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    Channel& channel = channels_[offset >= 0x30];
    switch (offset % 0x30) {
      case 0x00:
        if (value & 4) {
          channels_[0] = channels_[1] = Channel{};
          stream_.clear();
          if (fault_ == "reset") channels_[0].control = 4;
        } else {
          channel.control = value;
          if (value & 1 && fault_ != "start") channel.status &= ~1U;
        }
        break;
      case 0x04:
        channel.status &= ~(value & 0x7000);
        break;
      case 0x08:
        if ((channel.status & 1) == 0) fail("the first descriptor is written while the channel runs");
        channel.current = value;
        break;
      case 0x10:
        if ((channel.control & 1) == 0) fail("the last descriptor is written while the channel stands");
        channel.tail = value;
        channel.is_idle = false;
        break;
      default:
        fail("a register that is not written: " + std::to_string(offset));
    }
    changed_.notify_all();
  }

  std::uint8_t* memory() override { return memory_.data(); }
  std::size_t memory_bytes() const override { return memory_.size(); }
  std::uint32_t address() const override { return kAddress; }

  void wait(const firm::Deadline& deadline) override {
    std::unique_lock<std::mutex> lock(mutex_);
    while (!has_ended_ && (channels_[1].status & channels_[1].control & 0x7000) == 0 && !deadline.is_over()) {
      changed_.wait_for(lock, std::chrono::milliseconds(20));
    }
  }
  void end() override {
    const std::lock_guard<std::mutex> lock(mutex_);
    has_ended_ = true;
    changed_.notify_all();
  }

  std::string broken_rule() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return broken_rule_;
  }

 private:
  static constexpr std::uint32_t kAddress = 0x1F000000;

  struct Channel {
    std::uint32_t control = 0, status = 1, current = 0, tail = 0;
    bool is_idle = true;
  };
  struct Piece {
    firm::Bytes bytes;
    bool is_last;
  };

  void fail(const std::string& rule) {
    if (broken_rule_.empty()) broken_rule_ = rule;
  }

  volatile std::uint32_t* descriptor(std::uint32_t address) {
    if (address % 64 != 0 || address < kAddress || address + 64 - kAddress > memory_.size()) {
      fail("a descriptor at " + std::to_string(address));
      address = kAddress;
    }
    return reinterpret_cast<volatile std::uint32_t*>(memory_.data() + (address - kAddress));
  }

  // The memory of a descriptor's buffer.
  std::uint8_t* buffer(volatile std::uint32_t* words, std::size_t size) {
    const std::uint32_t address = words[2];
    if (address % 64 != 0 || address < kAddress || address - kAddress + size > memory_.size() || size == 0) {
      fail("a buffer of " + std::to_string(size) + " bytes at " + std::to_string(address));
      return memory_.data();
    }
    return memory_.data() + (address - kAddress);
  }

  static bool may_work(const Channel& channel) {
    return (channel.control & 1) != 0 && (channel.status & 0x771) == 0 && !channel.is_idle;
  }

  void work() {
    std::unique_lock<std::mutex> lock(mutex_);
    while (!is_over_) {
      if (may_work(channels_[0]) && stream_.size() < kPieces && !(fault_ == "stall" && frames_ == at_)) {
        step(channels_[0], [this](volatile std::uint32_t* words) { fetch(words); });
      } else if (may_work(channels_[1]) && !stream_.empty()) {
        step(channels_[1], [this](volatile std::uint32_t* words) { store(words); });
      } else {
        changed_.wait(lock);
      }
      lock.unlock();  // others get their turn
      lock.lock();
    }
  }

  template <typename Work>
  void step(Channel& channel, Work work) {
    auto* const words = descriptor(channel.current);
    if (words[7] & 1U << 31) {
      channel.status |= 1U << 8 | 1U;  // SGIntErr
      return fail("a descriptor that is complete was handed over");
    }
    work(words);
    channel.is_idle = channel.current == channel.tail;
    channel.current = words[0];
  }

  void fetch(volatile std::uint32_t* words) {
    const std::size_t size = words[6] & 0x3FFFFFF;
    const bool is_first = words[6] & 1U << 27, is_last = words[6] & 1U << 26;
    if (is_first != begins_) fail("a frame begins within another one, or none does");
    if (!is_last && size % 64 != 0) fail("a frame goes on behind half a beat");
    begins_ = is_last;
    const std::uint8_t* bytes = buffer(words, size);
    stream_.push_back({firm::Bytes(bytes, bytes + size), is_last});
    words[7] = static_cast<std::uint32_t>(size) | 1U << 31;
    if (!is_last || frames_++ != at_) return;
    if (fault_ == "decode") channels_[0].status |= 1U << 6 | 1U;
    if (fault_ == "slave") channels_[1].status |= 1U << 5 | 1U | 1U << 14;
    if (fault_ == "halt") channels_[1].status |= 1U;
    if (fault_ == "overrun") words[7] = words[7], overrun_ = true;
    changed_.notify_all();
  }

  void store(volatile std::uint32_t* words) {
    Piece& piece = stream_.front();
    const std::size_t size = std::min<std::size_t>(piece.bytes.size(), words[6] & 0x3FFFFFF);
    std::memcpy(buffer(words, size), piece.bytes.data(), size);
    const bool is_whole = size == piece.bytes.size();
    const bool is_last = is_whole && piece.is_last;
    std::uint32_t status = static_cast<std::uint32_t>(size) | 1U << 31;
    if (stores_first_) status |= 1U << 27;
    if (is_last) status |= 1U << 26;
    if (overrun_) status |= 0x3FFFFFF;
    stores_first_ = is_last;
    if (is_whole) {
      stream_.pop_front();
    } else {
      piece.bytes.erase(piece.bytes.begin(), piece.bytes.begin() + static_cast<std::ptrdiff_t>(size));
    }
    words[7] = status;
    // The threshold of the interrupt counts frames.
    if (is_last) channels_[1].status |= 1U << 12;
    changed_.notify_all();
  }

  static constexpr std::size_t kPieces = 4;  // that are in the system

  // The driver and the engine share it without a lock, as they do a descriptor's status.
  firm::Bytes memory_;
  const std::string fault_;
  const unsigned at_;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  Channel channels_[2];
  std::deque<Piece> stream_;
  bool begins_ = true, stores_first_ = true, overrun_ = false;
  unsigned frames_ = 0;
  bool has_ended_ = false, is_over_ = false;
  std::string broken_rule_;
  std::thread thread_;
};

static std::vector<firm::Bytes> random_frames(unsigned count, std::size_t longest, unsigned seed) {
  std::mt19937 source(seed);
  std::vector<firm::Bytes> frames;
  for (unsigned number = 0; number < count; ++number) {
    firm::Bytes payload(source() % (longest + 1));
    for (auto& byte : payload) byte = static_cast<std::uint8_t>(source());
    frames.push_back(firm::pack_frame(static_cast<std::uint8_t>(source()), payload.data(), payload.size()));
  }
  return frames;
}

// The record of the aborted frame 7.
static const firm::Bytes kRecord{255, 255, 255, 255, 255, 7, 10};

// What is wrong; nothing if all came back.
static std::string play(firm::Transport& transport, const std::vector<firm::Bytes>& frames, bool is_limited) {
  std::string sender_error;
  std::thread sender([&] {
    try {
      for (const auto& frame : frames) transport.send(frame.data(), frame.size());
    } catch (const firm::TransportError& error) {
      sender_error = error.what();
    }
  });
  std::string error;
  try {
    for (const auto& frame : frames) {
      const auto burst = transport.receive(std::chrono::seconds(is_limited ? 1 : 60));
      if (!burst) error = "nothing came in time";
      // The system sends all frames back; a record comes as a burst that aborts its frame.
      const bool is_record = frame == kRecord;
      if (burst && burst->data != (is_record ? firm::Bytes{kRecord[5]} : frame)) error = "a burst differs";
      if (burst && burst->is_aborted != is_record) error = "a burst aborts its frame or not";
      if (!error.empty()) break;
    }
  } catch (const firm::TransportError& fault) {
    error = fault.what();
  }
  if (!error.empty()) transport.close();
  sender.join();
  return error == "nothing came in time" && !sender_error.empty() ? sender_error : error;
}

static int run_files(const std::string& root) {
  firm::LinuxDmaDevice device("/dev/uio3", "udmabuf0", false, root);
  device.write(0x30, 0x1234567);
  device.memory()[5] = 0xAB;
  std::cout << "ok " << device.read(0x34) << " " << device.memory_bytes() << " " << device.address() << "\n";
  return 0;
}

int main(int, char** words) {
  try {
    if (std::string(words[1]) == "files") return run_files(words[2]);
    auto frames = random_frames(static_cast<unsigned>(std::stoul(words[1])), std::stoul(words[2]),
                                static_cast<unsigned>(std::stoul(words[4])));
    frames.insert(frames.begin() + 1, kRecord);
    const std::string fault = words[5];
    auto device = std::make_unique<FakeDma>(1 << 22, fault, static_cast<unsigned>(std::stoul(words[6])));
    const FakeDma& model = *device;
    firm::DmaOptions options;
    options.buffer_bytes = std::stoul(words[3]);
    options.send_buffers = 4;
    options.receive_buffers = 3;
    firm::DmaTransport transport(std::move(device), {}, options);
    const auto begun = std::chrono::steady_clock::now();
    const std::string error = play(transport, frames, fault != "none");
    const std::chrono::duration<double> time = std::chrono::steady_clock::now() - begun;
    std::size_t bytes = 0;
    for (const auto& frame : frames) bytes += frame.size();
    if (!model.broken_rule().empty()) {
      std::cout << "rule: " << model.broken_rule() << "\n";
    } else if (!error.empty()) {
      std::cout << "error: " << error << "\n";
    } else {
      std::cout << "ok " << bytes << " " << time.count() << "\n";
    }
  } catch (const firm::TransportError& error) {
    std::cout << "error: " << error.what() << "\n";
  }
}
