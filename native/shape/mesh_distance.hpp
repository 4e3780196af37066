// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/vec.hpp"
#include "shape/triangle_mesh.hpp"
#include "shape/triangle_tree.hpp"

namespace matterfit::shape {

/// Exact signed distance to a mesh whose vertices may move between frames.
///
/// Sign from the angle-weighted normal of the nearest corner, edge or face (Bærentzen and Aanæs
/// 2005). Each shell has its own distance, so that overlapping solids join (least distance), and a
/// shell that faces inward within another is a cavity (largest distance); shells are combined from
/// the largest to the smallest. A closed shell that faces inward and lies in no other is turned. An
/// open shell is a sheet: solid behind its front, for `sheet_thickness`; past its rim is outside.
/// Inside overlapping solids the distance is a lower bound of the true depth.
class MeshDistance {
 public:
  enum class Kind { kSolid, kCavity, kSheet };

  struct Hit {
    double distance = 1e30;  ///< [m], negative inside
    Vec3d normal = Vec3d::UnitZ();
    Vec3d point = Vec3d::Zero();  ///< nearest point of the surface
    Vec3d weights = Vec3d::Zero();
    std::int32_t triangle = -1;  ///< −1: nothing within reach
  };

  /// `frames` must not be empty; all have equally many vertices. Throws Error(kCancelled) soon
  /// after that was asked of `interrupter`.
  MeshDistance(std::vector<Triangle> triangles, std::vector<std::vector<Vec3f>> frames,
               double sheet_thickness, const Interrupter* interrupter = nullptr);
  MeshDistance(const MeshDistance&) = delete;
  MeshDistance& operator=(const MeshDistance&) = delete;

  /// Whole-mesh distance between `frame` and the next at fraction `s`.
  [[nodiscard]] Hit at(const Vec3d& x, std::size_t frame = 0, double s = 0.0) const;

  /// Signed distance to one shell if nearer than `limit`; otherwise `triangle` is −1.
  [[nodiscard]] Hit at_shell(std::size_t shell, const Vec3d& x, std::size_t frame, double s,
                             double limit) const;
  /// Combines the shells, largest first: shell_hit(shell, current) gives a shell's Hit.
  template <class ShellHit>
  [[nodiscard]] Hit combine(const ShellHit& shell_hit) const {
    Hit result;
    for (const std::size_t shell : order_) {
      const Hit hit = shell_hit(shell, result);
      if (kinds_[shell] == Kind::kCavity ? hit.distance > result.distance
                                         : hit.distance < result.distance) {
        result = hit;
      }
    }
    return result;
  }

  /// Generalised winding number of all shells in the first frame: above ½ is inside.
  [[nodiscard]] double winding(const Vec3d& x) const;

  [[nodiscard]] std::size_t shell_count() const { return trees_.size(); }
  [[nodiscard]] Kind kind(std::size_t shell) const { return kinds_[shell]; }
  [[nodiscard]] double volume(std::size_t shell) const { return volumes_[shell]; }
  [[nodiscard]] const TriangleTree& tree(std::size_t shell) const { return *trees_[shell]; }
  [[nodiscard]] std::size_t turned_shells() const { return turned_shells_; }
  [[nodiscard]] const MeshTopology& topology() const { return topology_; }
  [[nodiscard]] const std::vector<std::vector<Vec3f>>& frames() const { return frames_; }

 private:
  [[nodiscard]] Vec3d feature_normal(const NearestTriangle& nearest, const VertexView& at,
                                     bool& on_rim) const;

  std::vector<std::vector<Vec3f>> frames_;
  MeshTopology topology_;
  std::vector<std::unique_ptr<TriangleTree>> trees_;
  std::vector<Kind> kinds_;
  std::vector<double> volumes_;
  std::vector<std::size_t> order_;  ///< shells, largest first, sheets last
  std::size_t turned_shells_ = 0;
  double sheet_thickness_;
};

}  // namespace matterfit::shape
