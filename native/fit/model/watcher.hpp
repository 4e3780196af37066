// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "base/parallel.hpp"
#include "fit/data/capture.hpp"
#include "fit/data/follow.hpp"
#include "fit/data/losses.hpp"
#include "mpm/observed_frame.hpp"
#include "mpm/scene.hpp"

namespace matterfit::fit {

/// Where a simulation is looked at for one capture: points that are bound to the body or, for the
/// Chamfer loss, particles of it, 8192 at most.
class Watcher {
 public:
  /// `rest`: the points (watched_points()); of the Chamfer loss none.
  Watcher(const mpm::Scene& scene, const CaptureInput& capture, Loss loss, Points rest,
          Arena& arena);

  [[nodiscard]] std::size_t body() const { return body_; }
  [[nodiscard]] std::size_t size() const { return points_ ? points_->size() : particles_.size(); }
  [[nodiscard]] Points positions(const mpm::Scene& scene, const mpm::ObservedFrame& frame,
                                 Arena& arena) const;
  [[nodiscard]] Points velocities(const mpm::ObservedFrame& frame, Arena& arena) const;
  /// The transpose of positions(); of bound points only.
  [[nodiscard]] const PointFollower& points() const { return *points_; }

 private:
  std::size_t body_ = 0;
  std::optional<PointFollower> points_;
  std::vector<std::size_t> particles_;
};

/// Points that a loss looks at of a body as it was built: the capture's own or, for the surface
/// loss, of the body's surface, 8192 at most. Throws Error(kInput) where it has none.
[[nodiscard]] Points watched_points(const mpm::Scene& scene, const Capture& capture, Loss loss,
                                    Arena& arena);

}  // namespace matterfit::fit
