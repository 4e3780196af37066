// SPDX-License-Identifier: GPL-3.0-or-later
#include "bake/pc2.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <limits>
#include <string>
#include <system_error>
#include <utility>

#include "base/error.hpp"

namespace matterfit::bake {
namespace {

static_assert(std::endian::native == std::endian::little, "PC2 is little endian");
static_assert(sizeof(Vec3f) == 12);

constexpr std::size_t kHeaderSize = 32;
using Header = std::array<char, kHeaderSize>;

Header make_header(const Pc2Writer::Options& options, std::int32_t samples) {
  Header header{};
  const std::int32_t version = 1;
  const auto points = static_cast<std::int32_t>(options.points);
  std::memcpy(header.data(), "POINTCACHE2", 12);
  std::memcpy(header.data() + 12, &version, 4);
  std::memcpy(header.data() + 16, &points, 4);
  std::memcpy(header.data() + 20, &options.start_frame, 4);
  std::memcpy(header.data() + 24, &options.sample_rate, 4);
  std::memcpy(header.data() + 28, &samples, 4);
  return header;
}

[[noreturn]] void fail(const std::filesystem::path& path, const char* what, int code) {
  std::string advice;
  if (code == ENOSPC || code == EFBIG || code == EDQUOT) {
    advice = " Free some space or choose another output folder.";
  } else if (code == EACCES || code == EROFS || code == EPERM) {
    advice = " Choose an output folder that can be written to.";
  }
  throw_output(path.string() + ": " + what + ": " + std::strerror(code) + "." + advice);
}

std::uint64_t frame_offset(std::size_t points, std::size_t frame) {
  return kHeaderSize + std::uint64_t{12} * points * frame;
}

}  // namespace

std::filesystem::path Pc2Writer::partial_path(const std::filesystem::path& path) {
  std::filesystem::path result = path;
  result += ".partial";
  return result;
}

Pc2Writer::Pc2Writer(std::filesystem::path path, const Options& options, int descriptor,
                     std::size_t frames)
    : path_(std::move(path)), options_(options), descriptor_(descriptor), frames_(frames) {}

Pc2Writer::Pc2Writer(Pc2Writer&& other) noexcept
    : path_(std::move(other.path_)),
      options_(other.options_),
      descriptor_(std::exchange(other.descriptor_, -1)),
      frames_(other.frames_) {}

Pc2Writer::Pc2Writer(std::filesystem::path path, const Options& options)
    : path_(std::move(path)), options_(options) {
  if (options.points > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max())) {
    throw_input(path_.string() + ": " + std::to_string(options.points) +
                " points are more than a PC2 file can hold (2147483647).");
  }
  const std::filesystem::path parent = path_.parent_path();
  if (!parent.empty()) {
    std::error_code code;
    std::filesystem::create_directories(parent, code);
    if (code) fail(parent, "cannot create the folder", code.value());
  }
  descriptor_ = ::open(partial_path(path_).c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (descriptor_ < 0) fail(path_, "cannot create the file", errno);
  try {
    write_header(0);
  } catch (...) {
    ::close(descriptor_);
    ::unlink(partial_path(path_).c_str());
    throw;
  }
}

Pc2Writer Pc2Writer::resume(std::filesystem::path path, const Options& options,
                            std::size_t frames) {
  const std::filesystem::path partial = partial_path(path);
  const int descriptor = ::open(partial.c_str(), O_RDWR | O_CLOEXEC);
  if (descriptor < 0) {
    const int code = errno;
    throw_input(partial.string() + ": cannot open to go on: " + std::strerror(code) +
                ". Bake again from the first frame.");
  }
  Pc2Writer writer(std::move(path), options, descriptor, frames);
  struct stat info {};
  Header header{};
  if (::fstat(descriptor, &info) != 0 || !S_ISREG(info.st_mode) ||
      ::pread(descriptor, header.data(), header.size(), 0) != static_cast<ssize_t>(kHeaderSize)) {
    throw_input(partial.string() + ": not a point cache. Bake again from the first frame.");
  }
  // A crash in finish() leaves the count set; it is written again.
  std::memset(header.data() + 28, 0, 4);
  if (header != make_header(options, 0)) {
    throw_input(partial.string() + ": was begun with another number of points (" +
                std::to_string(options.points) +
                " expected), start frame or sample rate. Bake again from the first frame.");
  }
  const std::uint64_t wanted = frame_offset(options.points, frames);
  if (static_cast<std::uint64_t>(info.st_size) < wanted) {
    throw_input(partial.string() + ": holds " + std::to_string(info.st_size) + " bytes, " +
                std::to_string(frames) + " frames need " + std::to_string(wanted) +
                ". Bake again from the first frame.");
  }
  if (::ftruncate(descriptor, static_cast<off_t>(wanted)) != 0) {
    fail(partial, "cannot cut off unfinished frames", errno);
  }
  return writer;
}

Pc2Writer::~Pc2Writer() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

void Pc2Writer::write(std::uint64_t offset, const void* data, std::size_t bytes) {
  const char* cursor = static_cast<const char*>(data);
  while (bytes > 0) {
    const ssize_t written = ::pwrite(descriptor_, cursor, bytes, static_cast<off_t>(offset));
    if (written < 0) {
      if (errno == EINTR) continue;
      fail(path_, "cannot write", errno);
    }
    cursor += written;
    offset += static_cast<std::uint64_t>(written);
    bytes -= static_cast<std::size_t>(written);
  }
}

void Pc2Writer::write_header(std::int32_t samples) {
  const Header header = make_header(options_, samples);
  write(0, header.data(), header.size());
}

void Pc2Writer::append(std::span<const Vec3f> positions) {
  if (positions.size() != options_.points) {
    throw_input(path_.string() + ": " + std::to_string(positions.size()) +
                " positions for a cache of " + std::to_string(options_.points) + " points.");
  }
  if (frames_ >= static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max())) {
    throw_input(path_.string() + ": more frames than a PC2 file can hold.");
  }
  write(frame_offset(options_.points, frames_), positions.data(), positions.size_bytes());
  ++frames_;
}

void Pc2Writer::flush() {
  if (::fsync(descriptor_) != 0 && errno != EINVAL) fail(path_, "cannot flush to disk", errno);
}

void Pc2Writer::finish() {
  write_header(static_cast<std::int32_t>(frames_));
  flush();
  const std::filesystem::path partial = partial_path(path_);
  const int descriptor = std::exchange(descriptor_, -1);
  if (::close(descriptor) != 0) fail(path_, "cannot close", errno);
  if (::rename(partial.c_str(), path_.c_str()) != 0) {
    fail(path_, "cannot rename the finished file", errno);
  }
}

}  // namespace matterfit::bake
