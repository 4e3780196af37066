// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

#include "base/error.hpp"

namespace matterfit::mpm {

/// Memory that the values take.
template <class Value>
std::size_t bytes_of(const std::vector<Value>& values) {
  return values.size() * sizeof(Value);
}

/// Checkpoint bytes: trivially copyable values and vectors of them, in order, sizes checked on the
/// way back. Same machine and version only; the job keeps the hash of its input beside them.
class ByteWriter {
 public:
  template <class Value>
  void put(const Value& value) {
    static_assert(std::is_trivially_copyable_v<Value>);
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof(Value));
  }
  template <class Value>
  void put(const std::vector<Value>& values) {
    static_assert(std::is_trivially_copyable_v<Value>);
    put(static_cast<std::uint64_t>(values.size()));
    bytes_.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(Value));
  }
  void reserve(std::size_t bytes) { bytes_.reserve(bytes); }
  [[nodiscard]] std::string take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

class ByteReader {
 public:
  explicit ByteReader(const std::string& bytes) : bytes_(bytes) {}
  template <class Value>
  void get(Value& value) {
    static_assert(std::is_trivially_copyable_v<Value>);
    need(sizeof(Value));
    std::memcpy(&value, bytes_.data() + cursor_, sizeof(Value));
    cursor_ += sizeof(Value);
  }
  /// Throws if the stored size differs from that of `values`: the checkpoint is of another scene.
  template <class Value>
  void get_same_size(std::vector<Value>& values) {
    std::uint64_t count = 0;
    get(count);
    if (count != values.size()) fail();
    get_values(values);
  }
  template <class Value>
  void get(std::vector<Value>& values) {
    std::uint64_t count = 0;
    get(count);
    if (count > (bytes_.size() - cursor_) / sizeof(Value)) fail();
    values.resize(count);
    get_values(values);
  }
  void expect_end() const {
    if (cursor_ != bytes_.size()) fail();
  }
  [[noreturn]] static void fail() {
    throw_input(
        "The checkpoint does not belong to this scene or version. Free the cache and simulate from "
        "the first frame.");
  }

 private:
  template <class Value>
  void get_values(std::vector<Value>& values) {
    need(values.size() * sizeof(Value));
    if (values.empty()) return;
    std::memcpy(values.data(), bytes_.data() + cursor_, values.size() * sizeof(Value));
    cursor_ += values.size() * sizeof(Value);
  }
  void need(std::size_t count) const {
    if (count > bytes_.size() - cursor_) fail();
  }
  const std::string& bytes_;
  std::size_t cursor_ = 0;
};

}  // namespace matterfit::mpm
