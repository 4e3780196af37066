// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/parallel.hpp"
#include "base/vec.hpp"
#include "capture/binding.hpp"
#include "fit/data/capture.hpp"
#include "fit/data/front.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::fit {

/// The simulation seen at a capture's own points and times.
struct SimulatedCapture {
  std::vector<double> times;      ///< (T) seconds after the scene's first frame
  std::vector<Vec3d> positions;   ///< (T, N) frame-major; NaN outside the simulated time
  std::vector<Vec3d> velocities;  ///< the same [m/s]; empty where they were not asked for
  std::size_t outside = 0;        ///< times before the first frame or after the last
  bool interpolated = false;      ///< some times lie between frames: a cubic through four
};

/// Points that move with one body, bound to it by their rest position (capture/binding.hpp), so
/// that markers that stand off the body turn with it; or the place of its front (front.hpp).
/// Immutable: safe to use from any thread.
class PointFollower {
 public:
  /// `rest` (N) where the points are on the body at rest, world; a point that is not finite is not
  /// followed. `separation` of the particles [m].
  PointFollower(const mpm::Body& body, Points rest, double separation, Arena& arena);
  /// The points of a capture, at `rest`, or its front.
  PointFollower(const mpm::Body& body, const CaptureInput& capture, Points rest, double separation,
                Arena& arena);

  [[nodiscard]] std::size_t size() const { return rest_.size(); }
  /// (N) at a state of the body; NaN where a point is not followed.
  [[nodiscard]] Points positions(const mpm::Body& body, const mpm::BodyState& state,
                                 Arena& arena) const;
  /// The same of a state that was not rounded, which has deformation gradients. Throws
  /// Error(kCompute) naming the particle that is at no place.
  [[nodiscard]] Points positions(const mpm::Body& body, const mpm::ObservedFrame::Body& state,
                                 Arena& arena) const;
  /// (N) [m/s]; NaN where a point is not followed.
  [[nodiscard]] Points velocities(const mpm::ObservedFrame::Body& state, Arena& arena) const;
  /// The transpose: adds the cotangents of positions() (N) at `state` to those of the particles'
  /// positions and deformation gradients, one each. Those of points that are not followed are
  /// ignored.
  void spread(const Points& bar, const mpm::ObservedFrame::Body& state,
              std::span<Vec3d> particle_bar, std::span<Mat3d> deformation_gradient_bar) const;
  /// How far the farthest point lies from the body's nearest particle at rest [m].
  [[nodiscard]] double farthest() const;

 private:
  /// The values of followed points at their places among all, NaN elsewhere.
  [[nodiscard]] Points among_all(const Points& followed) const;
  /// The front's point, which lies across as it did at rest.
  [[nodiscard]] Vec3d front_at(const mpm::Body& body, double reach) const;

  Points rest_;
  double separation_;
  std::vector<std::size_t> bound_;  ///< points that are followed
  std::optional<capture::MeshBinding> binding_;
  std::optional<Front> front_;
  Vec3d anchor_ = Vec3d::Zero();  ///< a particle at rest as the body was when it was bound
};

/// Positions at `times` [s] from those of whole frames, the first at time 0: `frames` (F) of
/// `points` points each. Between frames Catmull–Rom's cubic, straight in the first and the last
/// interval.
[[nodiscard]] SimulatedCapture at_times(const std::vector<Points>& frames, std::size_t points,
                                        const std::vector<double>& times, double fps);

/// Adds to `frames`, as many as are recorded, the cotangents of positions at one time: the
/// transpose of at_times(). A frame that is empty counts as zero.
void add_at_time(std::vector<Points>& frames, double time, double fps, std::span<const Vec3d> bar);

/// The transpose of at_times(): the cotangents of the frames' positions, from those of the
/// positions at `times`, (T, N) frame-major.
[[nodiscard]] std::vector<Points> frames_bar(std::size_t frames, std::size_t points,
                                             const std::vector<double>& times, double fps,
                                             const std::vector<Vec3d>& bar);

/// Index of the body of that name. Throws Error(kInput) if there is none.
[[nodiscard]] std::size_t body_index(const mpm::Scene& scene, const std::string& name);

}  // namespace matterfit::fit
