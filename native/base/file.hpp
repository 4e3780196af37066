// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

namespace matterfit {

/// Writes a file so that its final name never holds a partial one: bytes go to `PATH.tmp`, every
/// write, the flush, fsync and close are tested, then it is renamed. Destroyed without commit(),
/// the temporary file is removed. Errors are Error(kOutput) and name the path and the reason.
class AtomicFile {
 public:
  /// Creates missing parent folders.
  explicit AtomicFile(std::filesystem::path path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  void write(const void* data, std::size_t bytes);
  void write(std::string_view text) { write(text.data(), text.size()); }
  /// A std::ostream over this file, for libraries that want one. Failures set badbit at once and
  /// are thrown by commit(). Valid until commit() or destruction.
  [[nodiscard]] std::ostream& stream();
  [[nodiscard]] std::uint64_t size() const noexcept;
  void commit();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Writes `bytes` atomically.
void write_file(const std::filesystem::path& path, std::string_view bytes);

/// The whole file. Throws Error(kInput) if it is missing, unreadable, not a regular file, or larger
/// than `limit` bytes; the size is checked before memory is allocated.
[[nodiscard]] std::vector<std::byte> read_file(const std::filesystem::path& path,
                                               std::uint64_t limit = std::uint64_t{16} << 30U);

}  // namespace matterfit
