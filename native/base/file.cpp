// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <optional>
#include <streambuf>

#include "base/error.hpp"

namespace matterfit {
namespace {

std::string reason(int code) { return std::strerror(code); }

[[noreturn]] void fail(const std::filesystem::path& path, const char* what, int code) {
  std::string advice;
  if (code == ENOSPC || code == EFBIG || code == EDQUOT) {
    advice = " Free some space or choose another output folder.";
  } else if (code == EACCES || code == EROFS || code == EPERM) {
    advice = " Choose an output folder that can be written to.";
  }
  throw_output(path.string() + ": " + what + ": " + reason(code) + "." + advice);
}

}  // namespace

struct AtomicFile::Impl {
  /// Unbuffered on purpose: the libraries that use it write in large pieces of their own.
  class Buffer : public std::streambuf {
   public:
    explicit Buffer(Impl& owner) : owner_(owner) {}

   protected:
    std::streamsize xsputn(const char* text, std::streamsize count) override {
      try {
        owner_.write(text, static_cast<std::size_t>(count));
      } catch (const Error& error) {
        owner_.deferred = error.what();
        return 0;
      }
      return count;
    }
    int_type overflow(int_type c) override {
      if (traits_type::eq_int_type(c, traits_type::eof())) return traits_type::not_eof(c);
      const char byte = traits_type::to_char_type(c);
      return xsputn(&byte, 1) == 1 ? c : traits_type::eof();
    }
    pos_type seekoff(off_type offset, std::ios_base::seekdir way,
                     std::ios_base::openmode which) override {
      if (way == std::ios_base::cur)
        return seekpos(pos_type(off_type(owner_.position) + offset), which);
      if (way == std::ios_base::end)
        return seekpos(pos_type(off_type(owner_.size) + offset), which);
      return seekpos(pos_type(offset), which);
    }
    pos_type seekpos(pos_type position, std::ios_base::openmode) override {
      const off_type target = position;
      if (target < 0) return pos_type(off_type(-1));
      owner_.position = static_cast<std::uint64_t>(target);
      return position;
    }

   private:
    Impl& owner_;
  };

  std::filesystem::path path;
  std::filesystem::path temporary;
  int descriptor = -1;
  std::uint64_t position = 0;
  std::uint64_t size = 0;
  std::string deferred;
  std::optional<Buffer> buffer;
  std::optional<std::ostream> out;

  void write(const void* data, std::size_t bytes) {
    const char* cursor = static_cast<const char*>(data);
    while (bytes > 0) {
      const ssize_t written = ::pwrite(descriptor, cursor, bytes, static_cast<off_t>(position));
      if (written < 0) {
        if (errno == EINTR) continue;
        fail(path, "cannot write", errno);
      }
      cursor += written;
      bytes -= static_cast<std::size_t>(written);
      position += static_cast<std::uint64_t>(written);
      if (position > size) size = position;
    }
  }
};

AtomicFile::AtomicFile(std::filesystem::path path) : impl_(std::make_unique<Impl>()) {
  impl_->path = std::move(path);
  impl_->temporary = impl_->path;
  impl_->temporary += ".tmp";
  const std::filesystem::path parent = impl_->path.parent_path();
  if (!parent.empty()) {
    std::error_code code;
    std::filesystem::create_directories(parent, code);
    if (code) fail(parent, "cannot create the folder", code.value());
  }
  impl_->descriptor =
      ::open(impl_->temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (impl_->descriptor < 0) fail(impl_->path, "cannot create the file", errno);
}

AtomicFile::~AtomicFile() {
  if (impl_->descriptor >= 0) {
    ::close(impl_->descriptor);
    ::unlink(impl_->temporary.c_str());
  }
}

void AtomicFile::write(const void* data, std::size_t bytes) { impl_->write(data, bytes); }

std::ostream& AtomicFile::stream() {
  if (!impl_->out) {
    impl_->buffer.emplace(*impl_);
    impl_->out.emplace(&*impl_->buffer);
  }
  return *impl_->out;
}

std::uint64_t AtomicFile::size() const noexcept { return impl_->size; }

void AtomicFile::commit() {
  if (!impl_->deferred.empty()) throw_output(impl_->deferred);
  if (impl_->out && !impl_->out->good()) {
    throw_output(impl_->path.string() + ": cannot write: the stream failed.");
  }
  if (::fsync(impl_->descriptor) != 0 && errno != EINVAL) {
    fail(impl_->path, "cannot flush to disk", errno);
  }
  const int descriptor = impl_->descriptor;
  impl_->descriptor = -1;
  if (::close(descriptor) != 0) {
    const int code = errno;
    ::unlink(impl_->temporary.c_str());
    fail(impl_->path, "cannot close", code);
  }
  if (::rename(impl_->temporary.c_str(), impl_->path.c_str()) != 0) {
    const int code = errno;
    ::unlink(impl_->temporary.c_str());
    fail(impl_->path, "cannot rename the finished file", code);
  }
}

void write_file(const std::filesystem::path& path, std::string_view bytes) {
  AtomicFile file(path);
  file.write(bytes);
  file.commit();
}

std::vector<std::byte> read_file(const std::filesystem::path& path, std::uint64_t limit) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0) {
    const int code = errno;
    throw_input(path.string() + ": cannot open: " + reason(code) + ".");
  }
  struct Closer {
    int descriptor;
    ~Closer() { ::close(descriptor); }
  } const closer{descriptor};
  struct stat info {};
  if (::fstat(descriptor, &info) != 0 || !S_ISREG(info.st_mode)) {
    throw_input(path.string() + ": not a regular file.");
  }
  const auto size = static_cast<std::uint64_t>(info.st_size);
  if (size > limit) {
    throw_input(path.string() + ": " + std::to_string(size) + " bytes is more than the limit of " +
                std::to_string(limit) + ".");
  }
  std::vector<std::byte> bytes(size);
  std::uint64_t done = 0;
  while (done < size) {
    const ssize_t count = ::read(descriptor, bytes.data() + done, size - done);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {
      throw_input(path.string() + ": cannot read after byte " + std::to_string(done) + ".");
    }
    done += static_cast<std::uint64_t>(count);
  }
  return bytes;
}

}  // namespace matterfit
