// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cstring>

#include "base/error.hpp"
#include "base/file.hpp"
#include "capture/ply.hpp"

namespace matterfit::capture {
namespace {

constexpr std::size_t kBlockBytes = std::size_t{1} << 20U;

}  // namespace

void write_ply_points(const std::filesystem::path& path, std::span<const PlyColumn> columns,
                      std::span<const std::string> comments) {
  const std::string name = path.filename().string();
  if (columns.empty()) throw_output(name + ": a PLY of points needs at least one column.");
  const std::size_t count = columns[0].values.size();
  std::string header = "ply\nformat binary_little_endian 1.0\n";
  for (std::string comment : comments) {
    std::replace(comment.begin(), comment.end(), '\n', ' ');
    header += "comment " + comment + "\n";
  }
  header += "element vertex " + std::to_string(count) + "\n";
  for (const PlyColumn& column : columns) {
    if (column.values.size() != count) {
      throw_output(name + ": column '" + column.name + "' has " +
                   std::to_string(column.values.size()) + " values, the first has " +
                   std::to_string(count) + ".");
    }
    header += "property float " + column.name + "\n";
  }
  header += "end_header\n";

  AtomicFile file(path);
  file.write(header);
  const std::size_t rows = std::max<std::size_t>(1, kBlockBytes / (sizeof(float) * columns.size()));
  std::vector<float> block;
  for (std::size_t begin = 0; begin < count; begin += rows) {
    const std::size_t end = std::min(count, begin + rows);
    block.clear();
    for (std::size_t i = begin; i < end; ++i) {
      for (const PlyColumn& column : columns) block.push_back(column.values[i]);
    }
    file.write(block.data(), block.size() * sizeof(float));
  }
  file.commit();
}

}  // namespace matterfit::capture
