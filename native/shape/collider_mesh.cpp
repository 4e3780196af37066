// SPDX-License-Identifier: GPL-3.0-or-later
#include "shape/collider_mesh.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>

#include "base/error.hpp"
#include "shape/distance_grid.hpp"
#include "shape/mesh_distance.hpp"
#include "shape/rigid_motion.hpp"

namespace matterfit::shape {
namespace {

/// Grids reach at most this many voxels for the sake of motion within a frame; faster surfaces ask
/// the tree of triangles instead.
constexpr double kMostMotionVoxels = 16.0;

class MeshCollider final : public Collider {
 public:
  MeshCollider(std::string name, Contact contact, std::vector<Triangle> triangles,
               std::vector<std::vector<Vec3f>> frames, std::vector<double> times, Keyed<Pose> pose,
               const MeshColliderOptions& options)
      : Collider(std::move(name), contact),
        what_("Collider '" + this->name() + "'"),
        motion_(what_, std::move(pose)),
        times_(std::move(times)),
        options_(resolve(frames, options)),
        mesh_(std::move(triangles), std::move(frames), options_.band, options_.interrupter) {
    if (mesh_.shell_count() == 0) {
      throw_input(what_ + ": every face of the mesh is degenerate (two corners are the same).");
    }
    measure_motion();
    grids_ = std::make_unique<Grid[]>(mesh_.frames().size() * mesh_.shell_count());
    // The first grids now, so that a mesh too large for its voxel is refused before the run.
    for (std::size_t shell = 0; shell < mesh_.shell_count(); ++shell) (void)grid(0, shell);
    options_.interrupter = nullptr;
    const double all = static_cast<double>(bytes_.load()) * static_cast<double>(times_.size());
    if (all > options_.memory_limit) {
      throw_input(what_ + ": distance grids of " + std::to_string(times_.size()) +
                  " frames would take about " + std::to_string(all / 1e9) +
                  " GB; make voxel_size larger than " + std::to_string(options_.voxel_size) +
                  " m.");
    }
  }

  [[nodiscard]] double band() const override { return options_.band; }
  [[nodiscard]] bool animated() const override {
    return motion_.animated() || mesh_.frames().size() > 1;
  }

  [[nodiscard]] SurfacePoint closest(const Vec3d& position, double time) const override {
    const RigidState state = motion_.at(time);
    const Vec3d x = state.to_local(position);
    std::size_t frame = 0;
    double s = 0.0;
    double span = 0.0;  // of the interval in which the vertices move now
    locate(time, frame, s, span);
    const std::size_t nearer = s > 0.5 ? frame + 1 : frame;
    const double away = s > 0.5 ? 1.0 - s : s;

    const MeshDistance::Hit hit =
        mesh_.combine([&](std::size_t shell, const MeshDistance::Hit& current) {
          return shell_hit(shell, x, frame, s, nearer, away, current);
        });
    SurfacePoint result;
    if (hit.triangle < 0) {
      result.distance = std::clamp(hit.distance, -options_.band, options_.band);
      result.velocity = state.velocity_at(position);
      return result;
    }
    result.distance = hit.distance;
    result.normal = state.rotation * hit.normal;
    result.velocity = state.velocity_at(state.to_world(hit.point));
    if (span > 0.0) {
      const Triangle& t = mesh_.topology().triangles[static_cast<std::size_t>(hit.triangle)];
      Vec3d local = Vec3d::Zero();
      for (std::size_t i = 0; i < 3; ++i) {
        const auto v = static_cast<std::size_t>(t[i]);
        local += hit.weights[static_cast<Eigen::Index>(i)] *
                 (mesh_.frames()[frame + 1][v] - mesh_.frames()[frame][v]).cast<double>();
      }
      result.velocity += state.rotation * (local / span);
    }
    return result;
  }

 private:
  struct Grid {
    std::once_flag once;
    std::unique_ptr<DistanceGrid> grid;
  };

  static MeshColliderOptions resolve(const std::vector<std::vector<Vec3f>>& frames,
                                     MeshColliderOptions options) {
    Eigen::AlignedBox3d box;
    for (const Vec3f& p : frames[0]) box.extend(p.cast<double>());
    if (!(options.voxel_size > 0)) {
      // Around a small mesh a wide band would be millions of voxels, each with an exact distance.
      options.voxel_size = std::max(box.sizes().maxCoeff() / 64.0, options.band / 8.0);
    }
    if (!(options.voxel_size > 0)) options.voxel_size = 1e-3;
    if (!(options.band > 0)) options.band = 4.0 * options.voxel_size;
    return options;
  }

  /// Farthest way of a vertex of each shell in each interval between frames.
  void measure_motion() {
    const std::size_t shells = mesh_.shell_count();
    const auto& frames = mesh_.frames();
    motion_in_.assign((frames.size() - 1) * shells, 0.0);
    for (std::size_t f = 0; f + 1 < frames.size(); ++f) {
      for (std::size_t t = 0; t < mesh_.topology().triangles.size(); ++t) {
        double& most =
            motion_in_[f * shells + static_cast<std::size_t>(mesh_.topology().shells[t])];
        for (const std::int32_t v : mesh_.topology().triangles[t]) {
          const auto i = static_cast<std::size_t>(v);
          most = std::max(most, (frames[f + 1][i] - frames[f][i]).cast<double>().norm());
        }
      }
    }
  }

  void locate(double time, std::size_t& frame, double& s, double& span) const {
    if (times_.size() < 2) return;
    const auto after = std::upper_bound(times_.begin(), times_.end(), time);
    if (after == times_.begin()) return;
    frame = static_cast<std::size_t>(after - times_.begin()) - 1;
    if (frame + 1 == times_.size()) return;
    span = times_[frame + 1] - times_[frame];
    s = (time - times_[frame]) / span;
  }

  const DistanceGrid& grid(std::size_t frame, std::size_t shell) const {
    const std::size_t shells = mesh_.shell_count();
    Grid& entry = grids_[frame * shells + shell];
    std::call_once(entry.once, [&] {
      double motion = 0.0;  // half an interval on each side is this frame's
      if (frame > 0) motion = motion_in_[(frame - 1) * shells + shell];
      if (frame + 1 < mesh_.frames().size()) {
        motion = std::max(motion, motion_in_[frame * shells + shell]);
      }
      DistanceGrid::Options options;
      options.voxel_size = options_.voxel_size;
      options.band =
          options_.band + std::min(0.5 * motion, kMostMotionVoxels * options_.voxel_size);
      options.what = what_;
      options.interrupter = options_.interrupter;
      entry.grid = std::make_unique<DistanceGrid>(mesh_, shell, frame, options);
      bytes_ += entry.grid->bytes();
    });
    return *entry.grid;
  }

  MeshDistance::Hit shell_hit(std::size_t shell, const Vec3d& x, std::size_t frame, double s,
                              std::size_t nearer, double away,
                              const MeshDistance::Hit& current) const {
    MeshDistance::Hit far;
    const bool cavity = mesh_.kind(shell) == MeshDistance::Kind::kCavity;
    if (mesh_.tree(shell).box_distance(x, frame, s) >= options_.band) {
      far.distance = cavity ? -options_.band : options_.band;
      return far;
    }
    const double moved = s > 0.0 ? away * motion_in_[frame * mesh_.shell_count() + shell] : 0.0;
    const DistanceGrid::Bounds bounds = grid(nearer, shell).bounds(x);
    const double low = bounds.low - moved;
    const double sign = bounds.sign;
    if (low >= options_.band) {
      far.distance = sign * options_.band;
      return far;
    }
    // Known to lose against the shells seen so far.
    if (low > 0 && (cavity ? sign * low < current.distance && sign < 0
                           : sign * low > current.distance && sign > 0)) {
      return current;
    }
    MeshDistance::Hit hit = mesh_.at_shell(shell, x, frame, s, bounds.high + moved);
    if (hit.triangle >= 0 && std::abs(hit.distance) < options_.band) return hit;
    far.distance = hit.triangle < 0 || hit.distance > 0 ? options_.band : -options_.band;
    return far;
  }

  std::string what_;
  RigidMotion motion_;
  std::vector<double> times_;
  MeshColliderOptions options_;
  MeshDistance mesh_;
  std::vector<double> motion_in_;  ///< (frames − 1, shells) [m]
  mutable std::unique_ptr<Grid[]> grids_;
  mutable std::atomic<std::size_t> bytes_{0};
};

void check_options(const std::string& what, const MeshColliderOptions& options) {
  for (const double value : {options.voxel_size, options.band}) {
    if (!std::isfinite(value) || value < 0) {
      throw_input(what + ": voxel_size and band must be finite and not negative (0: automatic).");
    }
  }
}

}  // namespace

ColliderPtr make_mesh_collider(std::string name, Contact contact, const PolygonArrays& mesh,
                               Keyed<Pose> pose, const MeshColliderOptions& options) {
  const std::string what = "Collider '" + name + "'";
  check_options(what, options);
  std::vector<Triangle> triangles =
      triangulate(what, mesh.vertices, mesh.face_sizes, mesh.face_vertices);
  return std::make_shared<MeshCollider>(std::move(name), contact, std::move(triangles),
                                        std::vector<std::vector<Vec3f>>{mesh.vertices},
                                        std::vector<double>{0.0}, std::move(pose), options);
}

ColliderPtr make_deforming_collider(std::string name, Contact contact, const PolygonArrays& faces,
                                    std::vector<std::vector<Vec3f>> frames,
                                    std::vector<double> times, const MeshColliderOptions& options) {
  const std::string what = "Collider '" + name + "'";
  check_options(what, options);
  if (frames.empty() || frames.size() != times.size()) {
    throw_input(what + ": " + std::to_string(frames.size()) + " frames of vertices for " +
                std::to_string(times.size()) + " times; give one each, at least one.");
  }
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (frames[i].size() != frames[0].size()) {
      throw_input(what + ": frame " + std::to_string(i) + " has " +
                  std::to_string(frames[i].size()) + " vertices, the first one " +
                  std::to_string(frames[0].size()) +
                  "; a deforming collider keeps its faces. Was a modifier changing them?");
    }
    if (!std::isfinite(times[i]) || (i > 0 && !(times[i] > times[i - 1]))) {
      throw_input(what + ": times of the frames must ascend; frame " + std::to_string(i) +
                  " does not.");
    }
    for (const Vec3f& p : frames[i]) {
      if (!p.allFinite()) {
        throw_input(what + ": frame " + std::to_string(i) + " has a vertex that is not finite.");
      }
    }
  }
  std::vector<Triangle> triangles =
      triangulate(what, frames[0], faces.face_sizes, faces.face_vertices);
  return std::make_shared<MeshCollider>(std::move(name), contact, std::move(triangles),
                                        std::move(frames), std::move(times), Keyed<Pose>(Pose{}),
                                        options);
}

}  // namespace matterfit::shape
