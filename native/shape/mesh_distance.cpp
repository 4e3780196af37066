// SPDX-License-Identifier: GPL-3.0-or-later
#include "shape/mesh_distance.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace matterfit::shape {
namespace {

Vec3d triangle_normal(const Triangle& t, const VertexView& at) {
  return (at(t[1]) - at(t[0])).cross(at(t[2]) - at(t[0])).stableNormalized();
}

}  // namespace

MeshDistance::MeshDistance(std::vector<Triangle> triangles, std::vector<std::vector<Vec3f>> frames,
                           double sheet_thickness, const Interrupter* interrupter)
    : frames_(std::move(frames)),
      topology_(analyse_topology(std::move(triangles), frames_, interrupter)),
      sheet_thickness_(sheet_thickness) {
  const std::size_t shells = topology_.shell_count();
  std::vector<std::vector<std::int32_t>> members(shells);
  for (std::size_t t = 0; t < topology_.triangles.size(); ++t) {
    members[static_cast<std::size_t>(topology_.shells[t])].push_back(static_cast<std::int32_t>(t));
  }
  volumes_ = shell_volumes(topology_, frames_[0]);
  for (std::size_t s = 0; s < shells; ++s) {
    kinds_.push_back(topology_.shell_boundary[s] > 0 ? Kind::kSheet : Kind::kSolid);
    trees_.push_back(
        std::make_unique<TriangleTree>(topology_, std::move(members[s]), frames_, interrupter));
  }
  order_.resize(shells);
  std::iota(order_.begin(), order_.end(), std::size_t{0});
  std::stable_sort(order_.begin(), order_.end(), [&](std::size_t a, std::size_t b) {
    const bool sheet_a = kinds_[a] == Kind::kSheet;
    const bool sheet_b = kinds_[b] == Kind::kSheet;
    if (sheet_a != sheet_b) return sheet_b;
    return std::abs(volumes_[a]) > std::abs(volumes_[b]);
  });
  const VertexView at{frames_[0].data(), frames_[0].data(), 0.0};
  for (std::size_t i = 0; i < shells; ++i) {
    const std::size_t s = order_[i];
    if (kinds_[s] == Kind::kSheet || volumes_[s] >= 0) continue;
    const Triangle& first =
        topology_.triangles[static_cast<std::size_t>(trees_[s]->members().front())];
    double around = 0;
    for (std::size_t j = 0; j < i; ++j) around += trees_[order_[j]]->winding(at(first[0]));
    if (around > 0.5) {
      kinds_[s] = Kind::kCavity;
      continue;
    }
    turn_shell(topology_, static_cast<std::int32_t>(s));
    volumes_[s] = -volumes_[s];
    ++turned_shells_;
    // Its dipoles have turned too.
    trees_[s] =
        std::make_unique<TriangleTree>(topology_, trees_[s]->members(), frames_, interrupter);
  }
}

Vec3d MeshDistance::feature_normal(const NearestTriangle& nearest, const VertexView& at,
                                   bool& on_rim) const {
  const auto t = static_cast<std::size_t>(nearest.triangle);
  const Triangle& corners = topology_.triangles[t];
  const Vec3d own = triangle_normal(corners, at);
  on_rim = false;
  if (nearest.feature == 6) return own;
  if (nearest.feature >= 3) {
    const std::int32_t twin =
        topology_.twins[3 * t + static_cast<std::size_t>(nearest.feature - 3)];
    on_rim = twin == MeshTopology::kBoundary;
    if (twin < 0) return own;
    return own + triangle_normal(topology_.triangles[static_cast<std::size_t>(twin)], at);
  }
  const std::int32_t vertex = corners[static_cast<std::size_t>(nearest.feature)];
  Vec3d sum = Vec3d::Zero();
  for (std::int32_t i = topology_.vertex_offsets[static_cast<std::size_t>(vertex)];
       i < topology_.vertex_offsets[static_cast<std::size_t>(vertex) + 1]; ++i) {
    const auto other =
        static_cast<std::size_t>(topology_.vertex_triangles[static_cast<std::size_t>(i)]);
    if (topology_.shells[other] != topology_.shells[t]) continue;
    const Triangle& c = topology_.triangles[other];
    std::size_t k = 0;
    while (c[k] != vertex) ++k;
    const Vec3d a = at(c[(k + 1) % 3]) - at(vertex);
    const Vec3d b = at(c[(k + 2) % 3]) - at(vertex);
    sum += std::atan2(a.cross(b).norm(), a.dot(b)) * triangle_normal(c, at);
    on_rim = on_rim || topology_.twins[3 * other + k] == MeshTopology::kBoundary ||
             topology_.twins[3 * other + (k + 2) % 3] == MeshTopology::kBoundary;
  }
  return sum;
}

MeshDistance::Hit MeshDistance::at_shell(std::size_t shell, const Vec3d& x, std::size_t frame,
                                         double s, double limit) const {
  NearestTriangle nearest;
  nearest.distance2 = limit * limit;
  trees_[shell]->closest(x, frame, s, nearest);
  Hit hit;
  if (nearest.triangle < 0) return hit;
  const std::size_t next = std::min(frame + 1, frames_.size() - 1);
  const VertexView at{frames_[frame].data(), frames_[next].data(), next == frame ? 0.0 : s};
  bool on_rim = false;
  const Vec3d normal = feature_normal(nearest, at, on_rim);
  const Vec3d away = x - nearest.point;
  const double distance = std::sqrt(nearest.distance2);
  const bool sheet = kinds_[shell] == Kind::kSheet;
  double side = away.dot(normal) < 0 ? -1.0 : 1.0;
  if (sheet && side < 0 && (on_rim || distance > sheet_thickness_)) {
    if (!on_rim) return hit;
    side = 1.0;
  }
  hit.distance = side * distance;
  hit.point = nearest.point;
  hit.weights = nearest.weights;
  hit.triangle = nearest.triangle;
  // On a face its own normal has more digits than a short difference; so has the mean normal of an
  // edge or corner for a point on it.
  const double scale = nearest.point.cwiseAbs().maxCoeff() + distance;
  if (nearest.feature == 6) {
    hit.normal = normal;
  } else if (distance > 1e-9 * scale) {
    hit.normal = away * (side / distance);
  } else {
    hit.normal = normal.stableNormalized();
  }
  return hit;
}

MeshDistance::Hit MeshDistance::at(const Vec3d& x, std::size_t frame, double s) const {
  return combine([&](std::size_t shell, const Hit& current) {
    const double reach = trees_[shell]->box_distance(x, frame, s);
    // Outside its box a solid is at least that far, and a cavity at most minus that.
    if (kinds_[shell] == Kind::kCavity ? -reach < current.distance && reach > 0
                                       : reach > current.distance && reach > 0) {
      return current;
    }
    return at_shell(shell, x, frame, s, std::numeric_limits<double>::infinity());
  });
}

double MeshDistance::winding(const Vec3d& x) const {
  double sum = 0;
  for (const auto& tree : trees_) sum += tree->winding(x);
  return sum;
}

}  // namespace matterfit::shape
