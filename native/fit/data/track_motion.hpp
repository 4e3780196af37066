// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/parallel.hpp"
#include "base/vec.hpp"

namespace matterfit::fit {

/// Tracks of points inside a body. Times ascending and evenly spaced.
struct InteriorTracks {
  Points rest;                   ///< (N) where the points are on the body at rest; all finite
  std::vector<double> times;     ///< (T) [s]
  std::vector<Vec3d> positions;  ///< (T, N) frame-major; not finite where not seen
  double sigma = 0.0;            ///< standard deviation of a coordinate [m]
  double spacing = 0.0;          ///< cube root of the body's rest volume a point [m]

  [[nodiscard]] std::size_t points() const { return rest.size(); }
  [[nodiscard]] std::size_t frames() const { return times.size(); }
};

/// A hat function of time: 1 at frame `centre`, 0 at `half` frames before and after it.
struct Hat {
  std::size_t centre = 0;
  std::size_t half = 1;
};

/// How the places at which a balance is summed up move, by the tracks around them.
struct TrackMotion {
  std::vector<Vec3d> positions;      ///< (T, Q) [m]
  std::vector<Mat3d> gradients;      ///< (T, Q) deformation gradient against rest
  std::vector<std::uint8_t> known;   ///< (T, Q) 1: so many tracks are near that both are known
  std::vector<Vec3d> accelerations;  ///< (hats, Q) mean over the hat [m/s²]
  std::vector<std::uint8_t> known_accelerations;  ///< (hats, Q)
};

/// Weighted linear least squares over the nearest tracks (moving least squares, Lancaster and
/// Salkauskas 1981). The mean of ẍ over a hat is exactly its second difference. `flows` false:
/// neighbours and derivatives against rest, so nothing drifts. True: neighbours anew in each frame,
/// F_{k+1} = (I + ∂Δx/∂x_k) F_k, for bodies whose neighbourhoods change; a place that loses its
/// neighbours is not known from there on. Same result for any number of threads.
[[nodiscard]] TrackMotion track_motion(const InteriorTracks& tracks, const Points& places,
                                       const std::vector<Hat>& hats, bool flows, Arena& arena);

}  // namespace matterfit::fit
