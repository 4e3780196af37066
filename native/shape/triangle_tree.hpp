// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "base/cancel_check.hpp"
#include "base/vec.hpp"
#include "shape/triangle_mesh.hpp"

namespace matterfit::shape {

/// Vertices on the straight way between two frames: position (1 − s)·from + s·to.
struct VertexView {
  const Vec3f* from = nullptr;
  const Vec3f* to = nullptr;
  double s = 0.0;

  [[nodiscard]] Vec3d operator()(std::int32_t vertex) const {
    const Vec3d a = from[vertex].cast<double>();
    return s == 0.0 ? a : Vec3d(a + s * (to[vertex].cast<double>() - a));
  }
};

/// The nearest point of a set of triangles.
struct NearestTriangle {
  double distance2 = std::numeric_limits<double>::infinity();  ///< [m²]
  std::int32_t triangle = -1;
  int feature = 6;  ///< 0–2: that corner; 3–5: the edge from corner feature − 3; 6: the face
  Vec3d point = Vec3d::Zero();
  Vec3d weights = Vec3d::Zero();  ///< barycentric
};

/// Nearest point on triangle (a, b, c), Ericson, Real-Time Collision Detection (2005), 5.1.5.
/// `triangle` of the result is left at −1.
[[nodiscard]] NearestTriangle nearest_on_triangle(const Vec3d& x, const Vec3d& a, const Vec3d& b,
                                                  const Vec3d& c);

/// A tree of boxes over some triangles of a mesh whose vertices may move between frames; the tree
/// is that of the first frame, the boxes follow the vertices. Immutable.
class TriangleTree {
 public:
  /// `members` must not be empty; `topology` and `frames` must outlive the tree. Throws
  /// Error(kCancelled) soon after that was asked of `interrupter`.
  TriangleTree(const MeshTopology& topology, std::vector<std::int32_t> members,
               std::span<const std::vector<Vec3f>> frames,
               const Interrupter* interrupter = nullptr);

  /// Exact nearest point nearer than √nearest.distance2 of the mesh between `frame` (s = 0) and the
  /// next one (s = 1). Leaves `nearest` alone if there is none.
  void closest(const Vec3d& x, std::size_t frame, double s, NearestTriangle& nearest) const;
  /// Distance from `x` to the box around everything [m].
  [[nodiscard]] double box_distance(const Vec3d& x, std::size_t frame, double s) const;
  /// Generalised winding number of the first frame (Jacobson et al. 2013), with far triangles as
  /// dipoles (Barill et al. 2018): 1 inside a closed outward surface, 0 outside; error ≤ .05.
  [[nodiscard]] double winding(const Vec3d& x) const;

  [[nodiscard]] const std::vector<std::int32_t>& members() const { return members_; }

 private:
  struct Node {
    std::int32_t first;  ///< leaf: its first member; else its right child (the left one is next)
    std::int32_t count;  ///< 0: not a leaf
  };
  struct Box {
    Vec3f low, high;
  };
  struct Dipole {
    Vec3d centre, area;
    double radius;
  };

  std::int32_t build(std::size_t begin, std::size_t end, const std::vector<Vec3f>& centroids,
                     CancelCheck& check);
  [[nodiscard]] VertexView view(std::size_t frame, double s) const;
  [[nodiscard]] double box_distance2(std::size_t node, const Vec3d& x, std::size_t frame,
                                     double s) const;
  [[nodiscard]] double winding_below(std::size_t node, const Vec3d& x, const VertexView& at) const;

  const MeshTopology& topology_;
  std::span<const std::vector<Vec3f>> frames_;
  std::vector<std::int32_t> members_;
  std::vector<Node> nodes_;
  std::vector<std::vector<Box>> boxes_;  ///< a frame each
  std::vector<Dipole> dipoles_;
};

}  // namespace matterfit::shape
