// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/grid_alignment.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>

namespace matterfit::mpm {
namespace {

constexpr double kAligned = 1e-3;  // cells
/// The share of the largest layer's particles that an outermost one has where it is a flat face.
constexpr double kFlat = 0.9;

/// Whether the first and the last layer of particles along an axis are flat faces a whole number of
/// cells apart.
bool fits(const std::map<long, std::size_t>& layers, double cells_per_layer) {
  const double across = double(layers.rbegin()->first - layers.begin()->first + 1);
  const double cells = across * cells_per_layer;
  if (std::abs(cells - std::round(cells)) > kAligned) return false;
  std::size_t most = 0;
  for (const auto& [layer, count] : layers) most = std::max(most, count);
  const double least = kFlat * double(most);
  return double(layers.begin()->second) >= least && double(layers.rbegin()->second) >= least;
}

}  // namespace

std::optional<int> held_axis(const Pin& pin, const Mat3d& axes) {
  if (pin.region != Pin::Region::kPlane) return std::nullopt;
  const Vec3d normal = axes.transpose() * pin.normal.normalized();
  for (int axis = 0; axis < 3; ++axis) {
    if (std::abs(std::abs(normal[axis]) - 1.0) <= 1e-6) return axis;
  }
  return std::nullopt;
}

std::array<bool, 3> aligned_axes(const Body& body, double dx) {
  std::array<bool, 3> aligned{};
  const Mat3d axes = body.lattice.axes.normalized().toRotationMatrix();
  for (const Pin& pin : body.pins) {
    if (const std::optional<int> axis = held_axis(pin, axes)) aligned[std::size_t(*axis)] = true;
  }
  if (!body.lattice.regular || body.rest.empty()) return aligned;
  for (int axis = 0; axis < 3; ++axis) {
    std::map<long, std::size_t> layers;
    for (const Vec3d& x : body.rest) {
      const double along = axes.col(axis).dot(x - body.lattice.origin) / body.lattice.spacing;
      ++layers[std::lround(std::floor(along))];
    }
    if (fits(layers, body.lattice.spacing / dx)) aligned[std::size_t(axis)] = true;
  }
  return aligned;
}

}  // namespace matterfit::mpm
