// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_quadrature.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace matterfit::mpm {
namespace {

/// Thinner slices than this share of a box are rounding.
constexpr double kSliver = 1e-6;
/// Volumes of boxes that fill a cell may differ by as much: what is denser here than there is still
/// full, and where the surface cuts off less it is as good as full.
constexpr double kAlike = 0.05;

struct Slice {
  int cell;
  double middle;
  double width;
};

/// The parts of [x − edge/2, x + edge/2] in each cell; cell i is [i + ½, i + 3/2].
std::vector<Slice> slices(double x, double edge) {
  const double low = x - 0.5 * edge;
  const double high = x + 0.5 * edge;
  int first = static_cast<int>(std::floor(low - 0.5));
  int last = static_cast<int>(std::floor(high - 0.5));
  if (first + 1.5 - low < kSliver * edge) ++first;
  if (high - (last + 0.5) < kSliver * edge) --last;
  std::vector<Slice> result;
  for (int cell = first; cell <= last; ++cell) {
    const double a = cell == first ? low : cell + 0.5;
    const double b = cell == last ? high : cell + 1.5;
    result.push_back({cell, 0.5 * (a + b), b - a});
  }
  return result;
}

/// The first item of those sorted by cell that is not before `cell`.
template <class Item>
auto first_of(const std::vector<Item>& items, const Vec3i& cell) {
  return std::lower_bound(items.begin(), items.end(), cell,
                          [](const Item& item, const Vec3i& c) { return before(item.cell, c); });
}

/// A box's share of a cell, and the part of the cell that it covers.
struct Piece {
  QuadraturePoint point;
  double covered;
};

std::vector<Piece> cut(const std::vector<Vec3d>& coordinates, const std::vector<double>& volumes,
                       double edge) {
  std::vector<Piece> pieces;
  pieces.reserve(coordinates.size());
  for (std::uint32_t p = 0; p < coordinates.size(); ++p) {
    std::array<std::vector<Slice>, 3> parts;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      parts[axis] = slices(coordinates[p][static_cast<int>(axis)], edge);
    }
    for (const Slice& x : parts[0])
      for (const Slice& y : parts[1])
        for (const Slice& z : parts[2]) {
          const Vec3i cell(x.cell, y.cell, z.cell);
          const double covered = x.width * y.width * z.width;
          const double share = edge > 0.0 ? covered / (edge * edge * edge) : 1.0;
          const Vec3d f = Vec3d(x.middle, y.middle, z.middle) - cell.cast<double>();
          pieces.push_back({{cell, f, volumes[p] * share, p, PointKind::kPiece}, covered});
        }
  }
  std::stable_sort(pieces.begin(), pieces.end(), [](const Piece& a, const Piece& b) {
    return before(a.point.cell, b.point.cell);
  });
  return pieces;
}

using Pieces = std::vector<Piece>::const_iterator;

bool is_full(Pieces begin, Pieces end, const std::vector<double>& volumes) {
  double covered = 0.0;
  for (Pieces piece = begin; piece != end; ++piece) {
    covered += piece->covered;
    const double ratio = volumes[piece->point.particle] / volumes[begin->point.particle];
    if (!(std::abs(ratio - 1.0) < kAlike)) return false;
  }
  return std::abs(covered - 1.0) < 1e-6;
}

void add_gauss_points(Pieces begin, Pieces end, const std::vector<Vec3d>& coordinates,
                      std::vector<QuadraturePoint>& points) {
  const Vec3i cell = begin->point.cell;
  double volume = 0.0;
  for (Pieces piece = begin; piece != end; ++piece) volume += piece->point.volume;
  for (int i = 0; i < 8; ++i) {
    const Vec3d side = Vec3i(i / 4, i / 2 % 2, i % 2).cast<double>() - Vec3d::Constant(0.5);
    QuadraturePoint q{cell, Vec3d::Ones() + side / std::sqrt(3.0), volume / 8.0, 0,
                      PointKind::kGauss};
    double least = 1e30;
    for (Pieces piece = begin; piece != end; ++piece) {
      const std::uint32_t p = piece->point.particle;
      const double distance = (coordinates[p] - cell.cast<double>() - q.f).squaredNorm();
      if (distance < least) {
        least = distance;
        q.particle = p;
      }
    }
    points.push_back(q);
  }
}

}  // namespace

Vec3i Quadrature::cell_at(const Vec3i& cell, const Vec3i& otherwise) const {
  return filled.count({cell[0], cell[1], cell[2]}) > 0 ? cell : otherwise;
}

Quadrature cell_quadrature(const std::vector<Vec3d>& coordinates,
                           const std::vector<double>& volumes, double edge) {
  Quadrature result;
  const std::vector<Piece> pieces = cut(coordinates, volumes, edge);
  result.points.reserve(pieces.size());
  for (auto begin = pieces.begin(); begin != pieces.end();) {
    const Vec3i& cell = begin->point.cell;
    const auto end = std::find_if(begin, pieces.end(),
                                  [&](const Piece& piece) { return piece.point.cell != cell; });
    result.filled.insert({cell[0], cell[1], cell[2]});
    if (is_full(begin, end, volumes)) {
      add_gauss_points(begin, end, coordinates, result.points);
    } else {
      for (auto piece = begin; piece != end; ++piece) result.points.push_back(piece->point);
    }
    begin = end;
  }
  result.nearest.assign(coordinates.size(), 0);
  for (std::uint32_t p = 0; p < coordinates.size(); ++p) {
    Vec3i cell;
    for (int axis = 0; axis < 3; ++axis) {
      cell[axis] = static_cast<int>(std::floor(coordinates[p][axis] - 0.5));
    }
    result.cells.push_back(cell);
    auto q = first_of(result.points, cell);
    double least = 1e30;
    for (; q != result.points.end() && q->cell == cell; ++q) {
      const double distance = (q->f + cell.cast<double>() - coordinates[p]).squaredNorm();
      if (distance < least) {
        least = distance;
        result.nearest[p] = static_cast<std::uint32_t>(q - result.points.begin());
      }
    }
  }
  return result;
}

}  // namespace matterfit::mpm
