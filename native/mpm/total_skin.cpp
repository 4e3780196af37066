// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_skin.hpp"

#include <algorithm>
#include <array>
#include <map>

#include "mpm/halo.hpp"
#include "mpm/layout.hpp"

namespace matterfit::mpm {
namespace {

/// γ. Rebounds over sub-cell offsets and what it costs in substeps: docs/why.md.
constexpr double kTie = 0.25;
/// Rows of nodes with one lighter than this share of a full one belong to the skin.
constexpr double kLight = 0.5;

constexpr std::array<double, 4> kThirdDifference = {-1.0, 3.0, -3.0, 1.0};

}  // namespace

SkinTies::SkinTies(const TotalGrid& grid, double density, const std::vector<std::uint8_t>& held) {
  const std::vector<double>& mass = grid.mass();
  const double dx = grid.dx();
  const double light = kLight * density * dx * dx * dx;
  std::map<std::uint32_t, std::map<std::uint32_t, double>> matrix;
  const auto usable = [&](std::uint32_t node) {
    return node != kNoBlock && mass[node] > 0.0 && held[node] == 0;
  };
  for (std::uint32_t n = 0; n < mass.size(); ++n) {
    if (!usable(n)) continue;
    for (int axis = 0; axis < 3; ++axis) {
      std::array<std::uint32_t, 4> row = {n, kNoBlock, kNoBlock, kNoBlock};
      double least = mass[n];
      bool whole = true;
      for (std::size_t i = 1; i < row.size() && whole; ++i) {
        row[i] = grid.find_node(grid.node_coordinates(n) + static_cast<int>(i) * Vec3i::Unit(axis));
        whole = usable(row[i]);
        if (whole) least = std::min(least, mass[row[i]]);
      }
      if (!whole || least >= light) continue;
      const double stiffness = kTie * least / (density * dx * dx);
      for (std::size_t i = 0; i < row.size(); ++i)
        for (std::size_t j = 0; j < row.size(); ++j) {
          matrix[row[i]][row[j]] += stiffness * kThirdDifference[i] * kThirdDifference[j];
        }
    }
  }
  block_rows_.assign(grid.node_blocks() + 1, 0);
  if (matrix.empty()) return;
  rows_.reserve(matrix.size() + 1);
  for (const auto& [node, others] : matrix) {
    rows_.push_back({node, static_cast<std::uint32_t>(entries_.size())});
    for (const auto& [other, stiffness] : others) {
      if (other != node) entries_.push_back({other, stiffness});
    }
  }
  rows_.push_back({kNoBlock, static_cast<std::uint32_t>(entries_.size())});
  std::size_t row = 0;
  for (std::size_t b = 0; b <= grid.node_blocks(); ++b) {
    while (row + 1 < rows_.size() && rows_[row].node < b * kBlockNodes) ++row;
    block_rows_[b] = static_cast<std::uint32_t>(row);
  }
}

void SkinTies::add_forces(std::size_t node_block, double modulus, const double* displacement,
                          double* force) const {
  for (std::uint32_t r = block_rows_[node_block]; r < block_rows_[node_block + 1]; ++r) {
    const std::uint32_t node = rows_[r].node;
    double sum[3] = {0.0, 0.0, 0.0};
    // The row's sum is zero: differences keep the digits that a far motion would take.
    for (std::uint32_t e = rows_[r].first; e < rows_[r + 1].first; ++e) {
      for (std::size_t c = 0; c < 3; ++c) {
        sum[c] += entries_[e].stiffness * (displacement[component_of(entries_[e].node, c)] -
                                           displacement[component_of(node, c)]);
      }
    }
    for (std::size_t c = 0; c < 3; ++c) {
      force[c * kBlockNodes + node % kBlockNodes] -= modulus * sum[c];
    }
  }
}

}  // namespace matterfit::mpm
