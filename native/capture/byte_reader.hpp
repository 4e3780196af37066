// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstring>
#include <span>
#include <string>

#include "base/error.hpp"

namespace matterfit::capture {

static_assert(std::endian::native == std::endian::little);

/// A number of type T at `data`, which need not be aligned; `big` where its bytes are big-endian.
template <class T>
[[nodiscard]] T load(const std::byte* data, bool big = false) {
  std::array<std::byte, sizeof(T)> raw;
  std::memcpy(raw.data(), data, sizeof(T));
  if (big) std::reverse(raw.begin(), raw.end());
  return std::bit_cast<T>(raw);
}

/// A cursor over bytes of a file that never leaves them: reading past the end is Error(kInput) with
/// the file's name, the offset and what was to be read.
class ByteReader {
 public:
  ByteReader(std::span<const std::byte> bytes, const std::string& name, bool big_endian = false)
      : bytes_(bytes), name_(name), big_(big_endian) {}

  [[nodiscard]] std::size_t offset() const { return offset_; }
  [[nodiscard]] std::size_t remaining() const { return bytes_.size() - offset_; }
  void set_big_endian(bool big) { big_ = big; }

  void seek(std::size_t offset, const char* what) {
    if (offset > bytes_.size()) {
      throw_input(name_ + ": " + what + " should be at byte " + std::to_string(offset) +
                  ", but the file ends at byte " + std::to_string(bytes_.size()) +
                  ". Is it truncated?");
    }
    offset_ = offset;
  }
  std::span<const std::byte> take(std::size_t count, const char* what) {
    if (count > remaining()) {
      throw_input(name_ + ": " + what + " at byte " + std::to_string(offset_) + " needs " +
                  std::to_string(count) + " bytes, but only " + std::to_string(remaining()) +
                  " follow. Is it truncated?");
    }
    const auto piece = bytes_.subspan(offset_, count);
    offset_ += count;
    return piece;
  }
  template <class T>
  T read(const char* what) {
    return load<T>(take(sizeof(T), what).data(), big_);
  }
  [[noreturn]] void fail(const std::string& reason) const {
    throw_input(name_ + ": at byte " + std::to_string(offset_) + ": " + reason);
  }

 private:
  std::span<const std::byte> bytes_;
  std::string name_;
  std::size_t offset_ = 0;
  bool big_;
};

}  // namespace matterfit::capture
