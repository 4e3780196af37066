// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace matterfit::capture {

/// One property of a PLY element, all values of a column together.
struct PlyProperty {
  using Values =
      std::variant<std::vector<std::int8_t>, std::vector<std::uint8_t>, std::vector<std::int16_t>,
                   std::vector<std::uint16_t>, std::vector<std::int32_t>,
                   std::vector<std::uint32_t>, std::vector<float>, std::vector<double>>;
  std::string name;
  Values values;  ///< one value a row; lists concatenated
  bool is_list = false;
  std::vector<std::uint32_t> sizes;  ///< lists: values of each row

  [[nodiscard]] std::vector<float> floats() const;
  [[nodiscard]] std::vector<double> doubles() const;
  /// Integers; floating values are truncated, those outside int64 become 0.
  [[nodiscard]] std::vector<std::int64_t> integers() const;
};

struct PlyElement {
  std::string name;
  std::size_t count = 0;
  std::vector<PlyProperty> properties;

  /// nullptr if there is none of this name.
  [[nodiscard]] const PlyProperty* find(std::string_view property) const;
};

struct Ply {
  std::vector<PlyElement> elements;
  std::vector<std::string> comments;  ///< text after "comment " of the header

  [[nodiscard]] const PlyElement* find(std::string_view element) const;
};

/// A PLY 1.0 (ASCII, binary little or big endian; any elements, scalar and list properties) in
/// memory. `name` stands in messages. Counts are checked against the bytes that are there before
/// memory is allocated. Throws Error(kInput) naming offset (or line) and reason.
[[nodiscard]] Ply parse_ply(std::span<const std::byte> bytes, const std::string& name);
[[nodiscard]] Ply read_ply(const std::filesystem::path& path);

/// x, y, z of the element "vertex", 3·N values; Error(kInput) naming `name` if they are missing.
[[nodiscard]] std::vector<double> ply_positions(const Ply& ply, const std::string& name);

/// A column of float32 values to write; borrowed for the call.
struct PlyColumn {
  std::string name;
  std::span<const float> values;
};

/// Writes an element "vertex" with these columns (all of one length), binary little endian, in the
/// order given. Through AtomicFile; deterministic bytes.
void write_ply_points(const std::filesystem::path& path, std::span<const PlyColumn> columns,
                      std::span<const std::string> comments = {});

}  // namespace matterfit::capture
