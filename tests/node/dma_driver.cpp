// firm/dma_transport.hpp before the model of AXI DMA in dma_engine.py, whose stream comes back as it goes.
//
// `ROOT COUNT LONGEST BUFFER_BYTES SEED SECONDS`: random frames are sent by one thread and must come back to another, each
// within some seconds, through the files of a board below ROOT. `files ROOT` opens a device made of files instead. Output is
// one line: `ok BYTES SECONDS`, or `error: ...`.
#include <firm/dma_transport.hpp>

#include <iostream>
#include <random>
#include <thread>

#include "engine_registers.hpp"

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
static std::string play(firm::Transport& transport, const std::vector<firm::Bytes>& frames,
                        std::chrono::seconds limit) {
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
      const auto burst = transport.receive(limit);
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
  firm::LinuxDmaDevice device("/dev/uio0", "udmabuf0", false, root);
  device.write(0x30, 0x1234567);
  device.memory()[5] = 0xAB;
  std::cout << "ok " << device.read(0x34) << " " << device.memory_bytes() << " " << device.address() << "\n";
  return 0;
}

int main(int, char** words) {
  try {
    if (std::string(words[1]) == "files") return run_files(words[2]);
    auto frames = random_frames(static_cast<unsigned>(std::stoul(words[2])), std::stoul(words[3]),
                                static_cast<unsigned>(std::stoul(words[5])));
    frames.insert(frames.begin() + 1, kRecord);
    const std::string root = words[1];
    auto device = std::make_unique<firm::LinuxDmaDevice>("/dev/uio0", "udmabuf0", true, root, engine_registers(root));
    firm::DmaOptions options;
    options.buffer_bytes = std::stoul(words[4]);
    options.send_buffers = 4;
    options.receive_buffers = 3;
    firm::DmaTransport transport(std::move(device), {}, options);
    const auto begun = std::chrono::steady_clock::now();
    const std::string error = play(transport, frames, std::chrono::seconds(std::stoul(words[6])));
    const std::chrono::duration<double> time = std::chrono::steady_clock::now() - begun;
    std::size_t bytes = 0;
    for (const auto& frame : frames) bytes += frame.size();
    if (!error.empty()) {
      std::cout << "error: " << error << "\n";
    } else {
      std::cout << "ok " << bytes << " " << time.count() << "\n";
    }
  } catch (const firm::TransportError& error) {
    std::cout << "error: " << error.what() << "\n";
  }
}
