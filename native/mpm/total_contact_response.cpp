// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "mpm/total_grid.hpp"

namespace matterfit::mpm {
namespace {

/// Iterations of the power method, and by how much its result is raised: it comes from below, and a
/// step close to the limit makes contact rough in the numbers that a fit differentiates by.
constexpr int kIterations = 40;
constexpr double kOverestimate = 1.5;

/// A particle's face and the nodes that move it.
struct Face {
  double area;  ///< [m²]
  NodeWeights weights;
};

/// Largest eigenvalue of M⁻¹ Wᵀ A W [m²/kg], by power iteration from the motion that unit forces
/// on all faces begin.
double largest_eigenvalue(const std::vector<Face>& faces, const std::vector<double>& inverse_mass) {
  std::vector<double> mode(inverse_mass.size(), 0.0);
  for (const Face& face : faces) {
    for (std::size_t n = 0; n < face.weights.nodes.size(); ++n) {
      const std::uint32_t node = face.weights.nodes[n];
      mode[node] += face.area * face.weights.weights[n] * inverse_mass[node];
    }
  }
  std::vector<double> image(mode.size());
  double largest = 0.0;
  for (int k = 0; k < kIterations; ++k) {
    double norm = 0.0;
    for (std::size_t n = 0; n < mode.size(); ++n) {
      if (inverse_mass[n] > 0.0) norm += mode[n] * mode[n] / inverse_mass[n];
    }
    if (!(norm > 0.0)) break;
    std::fill(image.begin(), image.end(), 0.0);
    double energy = 0.0;
    for (const auto& [area, w] : faces) {
      double at = 0.0;
      for (std::size_t n = 0; n < w.nodes.size(); ++n) at += w.weights[n] * mode[w.nodes[n]];
      energy += area * at * at;
      for (std::size_t n = 0; n < w.nodes.size(); ++n) {
        image[w.nodes[n]] += area * w.weights[n] * at * inverse_mass[w.nodes[n]];
      }
    }
    largest = std::max(largest, energy / norm);
    const double scale = 1.0 / std::sqrt(norm);
    for (std::size_t n = 0; n < mode.size(); ++n) mode[n] = scale * image[n];
  }
  return largest;
}

}  // namespace

double TotalGrid::contact_response() const {
  std::vector<std::pair<std::uint32_t, Vec3d>> skin;  // with its outward normals
  for (std::uint32_t p = 0; p < rest_.size(); ++p) {
    if (is_surface(p)) skin.emplace_back(p, outward_normal(p));
  }
  double largest = 0.0;
  std::vector<Face> faces;
  for (int direction = 0; direction < 6; ++direction) {
    Vec3d outward = Vec3d::Zero();
    outward[direction / 2] = direction % 2 == 0 ? -1.0 : 1.0;
    faces.clear();
    for (const auto& [p, normal] : skin) {
      if (normal.dot(outward) < 0.5) continue;
      const double edge = std::cbrt(volumes_[p]);
      const double distance = reach(p, axes_ * outward).distance;
      faces.push_back({edge * edge, field_weights(p, rest_[p] + distance * outward)});
    }
    largest = std::max(largest, largest_eigenvalue(faces, inverse_mass_));
  }
  return 2.0 * kOverestimate * largest;
}

}  // namespace matterfit::mpm
