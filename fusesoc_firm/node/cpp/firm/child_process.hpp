// SPDX-License-Identifier: Apache-2.0
// A command in a child process, with a pipe to it and one from it, at the file descriptors that it expects.
//
// A write to a dead child must fail and not raise SIGPIPE, which would end the whole node. Pipes have no flag for this,
// so the writing thread blocks the signal.
#pragma once

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include <firm/descriptor.hpp>
#include <firm/transport.hpp>

extern "C" char** environ;

namespace firm {

// Blocks SIGPIPE in this thread during its lifetime; write() then fails with EPIPE.
class SigpipeHeld {
 public:
  SigpipeHeld() {
    sigemptyset(&sigpipe_);
    sigaddset(&sigpipe_, SIGPIPE);
    ::pthread_sigmask(SIG_BLOCK, &sigpipe_, &before_);
  }
  ~SigpipeHeld() {
    // A pending signal is this thread's own, and would be delivered when unblocked.
    const timespec at_once{};
    if (!sigismember(&before_, SIGPIPE)) {
      while (::sigtimedwait(&sigpipe_, nullptr, &at_once) == SIGPIPE) {
      }
    }
    ::pthread_sigmask(SIG_SETMASK, &before_, nullptr);
  }
  SigpipeHeld(const SigpipeHeld&) = delete;
  SigpipeHeld& operator=(const SigpipeHeld&) = delete;

 private:
  sigset_t sigpipe_;
  sigset_t before_;
};

class ChildProcess {
 public:
  // Run `command` in the shell. The child reads descriptor `input` and writes descriptor `output`. Throws
  // TransportError.
  ChildProcess(const std::string& command, int input, int output) {
    auto [child_reads, we_write] = make_pipe();
    auto [we_read, child_writes] = make_pipe();
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    posix_spawn_file_actions_init(&actions);
    posix_spawnattr_init(&attributes);
    if (input != STDIN_FILENO) {
      posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    }
    posix_spawn_file_actions_adddup2(&actions, child_reads.get(), input);
    posix_spawn_file_actions_adddup2(&actions, child_writes.get(), output);
    // A separate process group: the shell's children end with it, and this process handles Ctrl-C.
    posix_spawnattr_setpgroup(&attributes, 0);
    sigset_t none;
    sigemptyset(&none);
    posix_spawnattr_setsigmask(&attributes, &none);
    sigset_t usual;
    sigemptyset(&usual);
    sigaddset(&usual, SIGPIPE);
    posix_spawnattr_setsigdefault(&attributes, &usual);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
    std::string shell = "sh", option = "-c", text = command;
    char* arguments[] = {shell.data(), option.data(), text.data(), nullptr};
    const int error = posix_spawn(&pid_, "/bin/sh", &actions, &attributes, arguments, environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) throw TransportError("cannot start '" + command + "': " + std::strerror(error));
    to_child_ = std::move(we_write);
    from_child_ = std::move(we_read);
  }

  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  ~ChildProcess() {
    kill();
    wait();
  }

  // Write all bytes; false if the child no longer reads. The caller holds a SigpipeHeld.
  bool write(const std::uint8_t* bytes, std::size_t size) {
    while (size > 0) {
      const ssize_t written = ::write(to_child_.get(), bytes, size);
      if (written < 0 && errno == EINTR) continue;
      if (written < 0 && errno == EPIPE) return false;
      if (written < 0) fail_with_errno("writing to the child process");
      bytes += written;
      size -= static_cast<std::size_t>(written);
    }
    return true;
  }

  // Read the available bytes, at least one; 0 at the end.
  std::size_t read(std::uint8_t* bytes, std::size_t size) {
    for (;;) {
      const ssize_t found = ::read(from_child_.get(), bytes, size);
      if (found >= 0) return static_cast<std::size_t>(found);
      if (errno != EINTR) fail_with_errno("reading from the child process");
    }
  }

  // Return whether the child has closed its output, as at its end.
  bool has_closed() const {
    pollfd output{from_child_.get(), 0, 0};
    return ::poll(&output, 1, 0) > 0 && (output.revents & POLLHUP) != 0;
  }

  // The descriptor to wait on for the child's output.
  int output() const { return from_child_.get(); }

  // Close the child's input.
  void end_input() { to_child_.reset(); }

  // Kill the child and all processes that it has started; any thread.
  void kill() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!has_ended_) ::kill(-pid_, SIGKILL);
  }

  // Wait for the end of the child and describe it, such as "ended with status 3". One thread only.
  std::string wait() {
    siginfo_t information;
    // The child stays a zombie as long as kill() may be called, because its number could be given to another process.
    while (!has_ended_ && ::waitid(P_PID, static_cast<id_t>(pid_), &information, WEXITED | WNOWAIT) < 0 &&
           errno == EINTR) {
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!has_ended_) {
      ::kill(-pid_, SIGKILL);  // processes that it left running
      ::waitpid(pid_, &status_, 0);
      has_ended_ = true;
    }
    if (WIFSIGNALED(status_)) return "was killed by signal " + std::to_string(WTERMSIG(status_));
    // By convention, the shell adds this to the number of the signal that ended its command.
    constexpr int kSignals = 128;
    const int status = WEXITSTATUS(status_);
    const std::string signal = status > kSignals ? " (signal " + std::to_string(status - kSignals) + ")" : "";
    return "ended with status " + std::to_string(status) + signal;
  }

  // Do the same, but kill the child after `patience`.
  std::string wait(std::chrono::nanoseconds patience) {
    const auto end = std::chrono::steady_clock::now() + patience;
    siginfo_t information{};
    while (!has_ended_ && information.si_pid == 0) {
      ::waitid(P_PID, static_cast<id_t>(pid_), &information, WEXITED | WNOWAIT | WNOHANG);
      if (information.si_pid == 0 && std::chrono::steady_clock::now() >= end) {
        kill();
        wait();
        return "did not end, so it was killed";
      }
      if (information.si_pid == 0) std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    return wait();
  }

 private:
  // Use numbers above those that the child expects, so that no dup2 closes another's descriptor; closed on exec.
  static Descriptor above(const Descriptor& low) {
    constexpr int kLowest = 10;
    const int high = ::fcntl(low.get(), F_DUPFD_CLOEXEC, kLowest);
    if (high < 0) fail_with_errno("a pipe");
    return Descriptor(high);
  }

  static std::pair<Descriptor, Descriptor> make_pipe() {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) fail_with_errno("a pipe");
    const Descriptor reads(ends[0]), writes(ends[1]);
    return {above(reads), above(writes)};
  }

  pid_t pid_ = 0;
  int status_ = 0;
  std::mutex mutex_;  // protects the members below
  bool has_ended_ = false;
  Descriptor to_child_;
  Descriptor from_child_;
};

}  // namespace firm
