// SPDX-License-Identifier: Apache-2.0
// AXI DMA between memory and the system's streams, for the block design of a board with a processor
// (docs/how-to/build-for-a-board.md): scatter-gather, 26-bit lengths, 32-bit addresses, no realignment.
//
// Each direction has a ring of descriptors, each with a buffer. Frames are copied into free buffers and are sent
// without pauses between them. Bursts fill the next free buffers, so several bursts may arrive while the processor is
// busy. A frame or burst that is longer than a buffer continues in the next buffer. PG021 (AXI DMA) describes registers
// and descriptors.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstring>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include <firm/descriptor.hpp>
#include <firm/dma_device.hpp>
#include <firm/transport.hpp>

namespace firm {

struct DmaOptions {
  std::size_t send_buffers = 16;
  std::size_t receive_buffers = 16;
  std::size_t buffer_bytes = 0;  // a multiple of 64; 0: the maximum that fits
};

// Completes all writes to memory before the engine is notified, and delays reads until the engine has reported. The
// processor orders memory and registers separately, so a barrier between threads is not sufficient.
inline void dma_barrier() {
#if defined(__aarch64__) || defined(__arm__)
  __asm__ volatile("dsb sy" ::: "memory");
#else
  __sync_synchronize();
#endif
}

// The offsets of the registers from a channel's first register, and the registers' bits.
namespace dma {
constexpr std::size_t kMm2s = 0x00, kS2mm = 0x30;
constexpr std::size_t kControl = 0x00, kStatus = 0x04, kFirstDescriptor = 0x08, kLastDescriptor = 0x10;
constexpr std::uint32_t kRun = 1U << 0, kReset = 1U << 2, kInterruptOnComplete = 1U << 12, kInterruptOnError = 1U << 14;
constexpr std::uint32_t kOneFrameAnInterrupt = 1U << 16;
constexpr std::uint32_t kHalted = 1U << 0, kHasScatterGather = 1U << 3, kInterrupts = 7U << 12;

// The words of a descriptor, and their bits.
constexpr std::size_t kDescriptorBytes = 64;
constexpr std::size_t kNext = 0, kBuffer = 2, kDescriptorControl = 6, kDescriptorStatus = 7;
constexpr std::uint32_t kLength = (1U << 26) - 1, kEndOfFrame = 1U << 26, kStartOfFrame = 1U << 27;
constexpr std::uint32_t kComplete = 1U << 31;
// Each buffer begins at a multiple of the widest stream's beat.
constexpr std::size_t kAlignment = 64;
}  // namespace dma

// The descriptors and buffers of one direction, used in turn.
class DmaRing {
 public:
  // `descriptors` and `buffers` are offsets in the device's memory.
  DmaRing(DmaDevice& device, std::size_t channel, std::size_t count, std::size_t descriptors, std::size_t buffers,
          std::size_t buffer_bytes)
      : device_(device),
        channel_(channel),
        count_(count),
        descriptors_(descriptors),
        buffers_(buffers),
        buffer_bytes_(buffer_bytes) {
    for (std::size_t index = 0; index < count; ++index) {
      for (std::size_t word = 0; word < dma::kDescriptorBytes / 4; ++word) this->word(index, word) = 0;
      word(index, dma::kNext) = address_of((index + 1) % count);
      word(index, dma::kBuffer) = device.address() + static_cast<std::uint32_t>(buffers + index * buffer_bytes);
    }
  }

  // Start the channel, which then waits for descriptors.
  void start(std::uint32_t interrupts) {
    dma_barrier();
    device_.write(channel_ + dma::kFirstDescriptor, address_of(0));
    device_.write(channel_ + dma::kControl, dma::kRun | dma::kOneFrameAnInterrupt | interrupts);
  }

  std::size_t buffer_bytes() const { return buffer_bytes_; }
  std::uint8_t* buffer(std::size_t index) { return device_.memory() + buffers_ + index * buffer_bytes_; }

  // Hand a descriptor with its control word to the engine.
  void hand_over(std::size_t index, std::uint32_t control) {
    word(index, dma::kDescriptorControl) = control;
    word(index, dma::kDescriptorStatus) = 0;
    dma_barrier();
    device_.write(channel_ + dma::kLastDescriptor, address_of(index));
  }

  // Return the status word of a descriptor, or nothing until the engine has completed the descriptor.
  std::optional<std::uint32_t> done(std::size_t index) {
    const std::uint32_t status = word(index, dma::kDescriptorStatus);
    if ((status & dma::kComplete) == 0) return std::nullopt;
    dma_barrier();
    return status;
  }

  std::size_t next(std::size_t index) const { return (index + 1) % count_; }

 private:
  volatile std::uint32_t& word(std::size_t index, std::size_t word) {
    std::uint8_t* place = device_.memory() + descriptors_ + index * dma::kDescriptorBytes;
    return reinterpret_cast<volatile std::uint32_t*>(place)[word];
  }
  std::uint32_t address_of(std::size_t index) const {
    return device_.address() + static_cast<std::uint32_t>(descriptors_ + index * dma::kDescriptorBytes);
  }

  DmaDevice& device_;
  std::size_t channel_;
  std::size_t count_;
  std::size_t descriptors_;
  std::size_t buffers_;
  std::size_t buffer_bytes_;
};

class DmaTransport : public Transport {
  // The interrupt comes at the end of a frame. If it is longer than all buffers, they must be emptied earlier.
  static constexpr std::chrono::milliseconds kLook{10};

 public:
  // Reset the engine and thereby the system. Throws TransportError.
  explicit DmaTransport(std::unique_ptr<DmaDevice> device, TransportOptions options = {}, DmaOptions dma = {})
      : options_(std::move(options)),
        device_(std::move(device)),
        count_(dma),
        to_system_(ring(dma::kMm2s, dma.send_buffers, 0)),
        from_system_(ring(dma::kS2mm, dma.receive_buffers, dma.send_buffers)) {
    if (!reset()) throw TransportError("the DMA engine does not leave reset; check the engine's clock");
    if ((device_->read(dma::kMm2s + dma::kStatus) & dma::kHasScatterGather) == 0) {
      throw TransportError("the DMA engine does not support scatter-gather, so it is not from a generated block design");
    }
    to_system_.start(dma::kInterruptOnError);
    from_system_.start(dma::kInterruptOnComplete | dma::kInterruptOnError);
    const auto runs = [this](std::size_t channel) {
      return is_cleared(channel + dma::kStatus, dma::kHalted);
    };
    if (!runs(dma::kMm2s) || !runs(dma::kS2mm)) throw TransportError("the DMA engine does not start");
    for (std::size_t index = 0; index < count_.receive_buffers; ++index) give_back(index);
  }

  ~DmaTransport() override { close(); }

  void send(const std::uint8_t* frame, std::size_t size) override {
    const std::lock_guard<std::mutex> lock(sending_mutex_);
    std::uint32_t start = dma::kStartOfFrame;
    while (size > 0) {
      wait_for_room();
      const std::size_t count = std::min(size, to_system_.buffer_bytes());
      const std::uint32_t end = count == size ? dma::kEndOfFrame : 0;
      std::memcpy(to_system_.buffer(sending_), frame, count);
      to_system_.hand_over(sending_, static_cast<std::uint32_t>(count) | start | end);
      sending_ = to_system_.next(sending_);
      ++handed_over_;
      start = 0;
      frame += count;
      size -= count;
    }
  }

  std::optional<Burst> receive(Timeout timeout = std::nullopt) override {
    const std::lock_guard<std::mutex> lock(receiving_mutex_);
    const Deadline deadline(timeout);
    while (!is_closed_) {
      if (const auto status = from_system_.done(receiving_)) {
        if (take(*status)) return without_record(std::exchange(burst_, {}));
        continue;
      }
      // A sender without further frames would not notice the loss of a frame in transfer.
      check(dma::kMm2s, "MM2S");
      check(dma::kS2mm, "S2MM");
      if (is_closed_ || deadline.is_over()) break;
      // Acknowledge the interrupt before looking at the descriptors, so that no completion is missed.
      device_->write(dma::kS2mm + dma::kStatus, dma::kInterrupts);
      if (!from_system_.done(receiving_)) device_->wait(Deadline(kLook).or_earlier(deadline));
    }
    return std::nullopt;
  }

  // Stop the engine, so that it does not write to released memory; no descriptor may be handed over during its reset.
  void close() override {
    if (is_closed_.exchange(true)) return;
    device_->end();
    const std::scoped_lock lock(sending_mutex_, receiving_mutex_);
    reset();
  }

 private:
  DmaRing ring(std::size_t channel, std::size_t count, std::size_t before) {
    const std::size_t all = count_.send_buffers + count_.receive_buffers;
    const std::size_t descriptors = all * dma::kDescriptorBytes;
    const std::size_t room = device_->memory_bytes() > descriptors ? device_->memory_bytes() - descriptors : 0;
    const std::size_t fitting = room / std::max<std::size_t>(all, 1) / dma::kAlignment * dma::kAlignment;
    const std::size_t most = dma::kLength / dma::kAlignment * dma::kAlignment;
    const std::size_t bytes = count_.buffer_bytes == 0 ? std::min(fitting, most) : count_.buffer_bytes;
    if (count < 2 || bytes == 0 || bytes % dma::kAlignment != 0 || bytes > std::min(fitting, most)) {
      throw TransportError("the DMA has " + std::to_string(count) + " buffers of " + std::to_string(bytes) +
                           " bytes; legal: 2 or more, a multiple of 64, and all within the " +
                           std::to_string(device_->memory_bytes()) + " bytes of memory");
    }
    return DmaRing(*device_, channel, count, before * dma::kDescriptorBytes, descriptors + before * bytes, bytes);
  }

  // Reset both channels with a single reset; return whether the reset has finished.
  bool reset() {
    device_->write(dma::kMm2s + dma::kControl, dma::kReset);
    return is_cleared(dma::kMm2s + dma::kControl, dma::kReset);
  }

  // Return whether a bit of a register becomes 0 within a short time.
  bool is_cleared(std::size_t offset, std::uint32_t bit) {
    const Deadline deadline(std::chrono::seconds(1));
    while ((device_->read(offset) & bit) != 0) {
      if (deadline.is_over()) return false;
    }
    return true;
  }

  void wait_for_room() {
    std::chrono::microseconds pause(5);
    while (handed_over_ == count_.send_buffers) {
      if (is_closed_) throw TransportError("the transport is closed");
      check(dma::kMm2s, "MM2S");
      if (to_system_.done(reclaiming_)) {
        reclaiming_ = to_system_.next(reclaiming_);
        --handed_over_;
      } else {
        // The only interrupt of UIO belongs to the receiver.
        std::this_thread::sleep_for(pause);
        pause = std::min(2 * pause, std::chrono::microseconds(500));
      }
    }
    check(dma::kMm2s, "MM2S");
    if (is_closed_) throw TransportError("the transport is closed");
  }

  // Append the content of a buffer; return whether the burst is complete.
  bool take(std::uint32_t status) {
    const std::size_t size = status & dma::kLength;
    const std::size_t longest = options_.longest_payload + kFrameHeaderBytes + dma::kAlignment;
    if (size > from_system_.buffer_bytes()) throw TransportError("the DMA engine wrote past the end of a buffer");
    if (status & dma::kStartOfFrame) burst_.data.clear(), is_too_long_ = false;
    is_too_long_ = is_too_long_ || burst_.data.size() + size > longest;
    if (!is_too_long_) {
      const std::uint8_t* buffer = from_system_.buffer(receiving_);
      burst_.data.insert(burst_.data.end(), buffer, buffer + size);
    }
    give_back(receiving_);
    receiving_ = from_system_.next(receiving_);
    if ((status & dma::kEndOfFrame) == 0) return false;
    if (is_too_long_ && options_.on_error) options_.on_error({});
    return !is_too_long_;
  }

  // A record of the hardware becomes a burst that aborts the frame (cores/axis, firm_axis_abort_record): the id 255, a
  // length that no frame has, the id of the frame, the code of the fault.
  static Burst without_record(Burst burst) {
    constexpr std::size_t kBytes = 7, kId = 5;
    const auto& data = burst.data;
    if (data.size() != kBytes || std::any_of(data.begin(), data.begin() + kId, [](auto byte) { return byte != 0xff; })) {
      return burst;
    }
    burst.data = {data[kId]};
    burst.is_aborted = true;
    return burst;
  }

  void give_back(std::size_t index) {
    from_system_.hand_over(index, static_cast<std::uint32_t>(from_system_.buffer_bytes()));
  }

  void check(std::size_t channel, const char* name) {
    struct EngineFault {
      std::uint32_t bit;
      const char* text;
    };
    static constexpr EngineFault kFaults[] = {{1U << 4, "DMAIntErr (internal)"},      {1U << 5, "DMASlvErr (response from memory)"},
                                        {1U << 6, "DMADecErr (address)"},       {1U << 8, "SGIntErr (descriptor)"},
                                        {1U << 9, "SGSlvErr (response from memory)"}, {1U << 10, "SGDecErr (address)"}};
    const std::uint32_t status = device_->read(channel + dma::kStatus);
    if (is_closed_) return;
    std::string text;
    for (const auto& fault : kFaults) {
      if (status & fault.bit) text += (text.empty() ? "" : ", ") + std::string(fault.text);
    }
    if (text.empty() && (status & dma::kHalted)) text = "the channel has halted";
    if (!text.empty()) throw TransportError(std::string("the DMA engine's ") + name + ": " + text);
  }

  const TransportOptions options_;
  const std::unique_ptr<DmaDevice> device_;
  const DmaOptions count_;
  std::atomic<bool> is_closed_{false};
  std::mutex sending_mutex_, receiving_mutex_;

  // Used by the sender only.
  DmaRing to_system_;
  std::size_t sending_ = 0;
  std::size_t reclaiming_ = 0;
  std::size_t handed_over_ = 0;

  // Used by the receiver only.
  DmaRing from_system_;
  std::size_t receiving_ = 0;
  Burst burst_;
  bool is_too_long_ = false;
};

}  // namespace firm
