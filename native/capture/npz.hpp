// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace matterfit::capture {

/// A NumPy array, in C order whatever the file's order was.
/// Types in files: <f4 <f8 <i4 <i8 |u1 |b1 <U are kept; <f2 becomes f4; |i1 <i2 <u2 become i4; <u4
/// and <u8 become i8. Big-endian and object arrays are refused.
struct Array {
  using Data =
      std::variant<std::vector<float>, std::vector<double>, std::vector<std::int32_t>,
                   std::vector<std::int64_t>, std::vector<std::uint8_t>, std::vector<std::string>>;
  std::vector<std::size_t> shape;  ///< empty: a scalar (one value)
  Data data;
  bool boolean = false;  ///< uint8 data that are 0 or 1, NumPy's bool

  Array() = default;
  template <class T>
  Array(std::vector<std::size_t> shape_in, std::vector<T> values)
      : shape(std::move(shape_in)), data(std::move(values)) {}

  /// Number of values: the product of the shape.
  [[nodiscard]] std::size_t size() const;
  /// "(40, 1200, 3)", for messages.
  [[nodiscard]] std::string shape_text() const;
  [[nodiscard]] bool is_text() const {
    return std::holds_alternative<std::vector<std::string>>(data);
  }
  /// Conversions of all values; `what` names the array in the Error(kInput) thrown for text, and by
  /// integers() for values that are not integers of 64 bits.
  [[nodiscard]] std::vector<double> doubles(const std::string& what) const;
  [[nodiscard]] std::vector<float> floats(const std::string& what) const;
  [[nodiscard]] std::vector<std::int64_t> integers(const std::string& what) const;
  [[nodiscard]] const std::vector<std::string>& texts(const std::string& what) const;
};

/// The arrays of a .npz by name (without ".npy").
using Arrays = std::map<std::string, Array>;

/// Name under which read_npz returns the one array of a .npy file.
inline constexpr const char* kNpyName = "positions";

struct NpzLimits {
  std::size_t entries = 4096;
  /// Bytes of all arrays together when unpacked. Independently of it an archive larger than 256 MiB
  /// unpacked and more than 100 times its packed size is refused.
  std::uint64_t bytes = std::uint64_t{16} << 30U;
};

/// One .npy in memory. `name` stands in messages. Throws Error(kInput) naming offset and reason.
[[nodiscard]] Array parse_npy(std::span<const std::byte> bytes, const std::string& name,
                              const NpzLimits& limits = {});

/// A .npz (stored or deflated zip of .npy) in memory. Sizes that the archive and the headers state
/// are checked against each other and the limits before memory is allocated.
[[nodiscard]] Arrays parse_npz(std::span<const std::byte> bytes, const std::string& name,
                               const NpzLimits& limits = {});

/// Reads a .npz, or a .npy as one array named kNpyName; told apart by content, not by suffix.
[[nodiscard]] Arrays read_npz(const std::filesystem::path& path, const NpzLimits& limits = {});

/// The array `name`; Error(kInput) naming `source` and the keys that are there if it is missing.
[[nodiscard]] const Array& require(const Arrays& arrays, const std::string& name,
                                   const std::string& source);

struct NpzWriteOptions {
  bool deflate = false;
};

/// Writes a .npz that numpy.load reads: entries in order of name, dated 1980-01-01, so equal arrays
/// give equal bytes. Through AtomicFile; throws Error(kOutput).
void write_npz(const std::filesystem::path& path, const Arrays& arrays,
               const NpzWriteOptions& options = {});

/// The bytes that write_npz writes.
[[nodiscard]] std::string format_npz(const Arrays& arrays, const NpzWriteOptions& options = {});

/// The bytes of one .npy (format 1.0, or 2.0 where the header needs it).
[[nodiscard]] std::string format_npy(const Array& array);

}  // namespace matterfit::capture
