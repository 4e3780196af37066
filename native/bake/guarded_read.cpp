// SPDX-License-Identifier: GPL-3.0-or-later
#include "bake/guarded_read.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <new>

#include "base/error.hpp"

#if defined(__SANITIZE_ADDRESS__)
#define MATTERFIT_ADDRESS_SANITIZER 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define MATTERFIT_ADDRESS_SANITIZER 1
#endif
#endif

namespace matterfit::bake {
namespace {

constexpr std::size_t kMessageLimit = 4000;

/// Address space this process maps now [bytes]; 0 if unknown.
std::uint64_t mapped_bytes() {
  std::FILE* file = std::fopen("/proc/self/statm", "re");
  if (file == nullptr) return 0;
  unsigned long pages = 0;
  const int fields = std::fscanf(file, "%lu", &pages);
  std::fclose(file);
  return fields == 1 ? std::uint64_t{pages} * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE))
                     : 0;
}

void limit(int resource, std::uint64_t value) {
  rlimit now{};
  ::getrlimit(static_cast<__rlimit_resource>(resource), &now);
  now.rlim_cur = std::min<rlim_t>(static_cast<rlim_t>(value), now.rlim_max);
  now.rlim_max = now.rlim_cur;
  ::setrlimit(static_cast<__rlimit_resource>(resource), &now);
}

void write_all(int descriptor, const char* text, std::size_t count) {
  while (count > 0) {
    const ssize_t written = ::write(descriptor, text, count);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return;
    text += written;
    count -= static_cast<std::size_t>(written);
  }
}

[[noreturn]] void child(int descriptor, const std::function<std::string()>& work,
                        const GuardLimits& limits, std::uint64_t mapped) {
  // Handlers of the host (Blender's crash reporter) must not run here.
  for (const int signal : {SIGSEGV, SIGABRT, SIGBUS, SIGFPE, SIGILL, SIGTERM, SIGINT}) {
    ::signal(signal, SIG_DFL);
  }
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_CPU, static_cast<std::uint64_t>(std::ceil(limits.seconds)) + 1);
#ifndef MATTERFIT_ADDRESS_SANITIZER  // its shadow alone maps terabytes
  if (mapped > 0) limit(RLIMIT_AS, mapped + limits.memory);
#else
  static_cast<void>(mapped);
#endif
  ::alarm(static_cast<unsigned>(std::ceil(limits.seconds)) + 1);
  std::string message;
  try {
    message = work();
  } catch (const std::bad_alloc&) {
    message = "needs more memory than the limit";
  } catch (const std::exception& error) {
    message = error.what();
    if (message.empty()) message = "cannot be read";
  } catch (...) {
    message = "cannot be read";
  }
  if (message.size() > kMessageLimit) message.resize(kMessageLimit);
  const std::string line = message.empty() ? std::string("+") : "-" + message;
  write_all(descriptor, line.data(), line.size());
  ::_exit(0);
}

}  // namespace

std::optional<std::string> run_guarded(const std::function<std::string()>& work,
                                       const GuardLimits& limits) {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
    throw_output(std::string("cannot check a file in a process of its own: ") +
                 std::strerror(errno) + ".");
  }
  const std::uint64_t mapped = mapped_bytes();
  std::fflush(nullptr);  // or the child would write buffered text again
  const pid_t pid = ::fork();
  if (pid < 0) {
    const int code = errno;
    ::close(ends[0]);
    ::close(ends[1]);
    throw_output(std::string("cannot check a file in a process of its own: ") +
                 std::strerror(code) + ".");
  }
  if (pid == 0) {
    ::close(ends[0]);
    child(ends[1], work, limits, mapped);
  }
  ::close(ends[1]);

  std::string text;
  bool late = false;
  const auto deadline = std::chrono::steady_clock::now() +
                        std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                            std::chrono::duration<double>(limits.seconds));
  for (;;) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
        deadline - std::chrono::steady_clock::now());
    if (left.count() <= 0) {
      late = true;
      break;
    }
    pollfd waiting{ends[0], POLLIN, 0};
    const int ready =
        ::poll(&waiting, 1, static_cast<int>(std::min<long long>(left.count(), 1000)));
    if (ready <= 0) continue;
    std::array<char, 4096> buffer{};
    const ssize_t count = ::read(ends[0], buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) break;
    text.append(buffer.data(), static_cast<std::size_t>(count));
  }
  ::close(ends[0]);
  if (late) ::kill(pid, SIGKILL);
  int status = 0;
  while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  if (late) {
    char seconds[32];
    std::snprintf(seconds, sizeof seconds, "%g", limits.seconds);
    return "could not be read within " + std::string(seconds) + " s: damaged, or very large";
  }
  if (text == "+") return std::nullopt;
  if (!text.empty() && text[0] == '-') return text.substr(1);
  if (WIFSIGNALED(status)) {
    return std::string("made its reader stop (") + ::strsignal(WTERMSIG(status)) + "): damaged";
  }
  return "could not be read: damaged";
}

}  // namespace matterfit::bake
