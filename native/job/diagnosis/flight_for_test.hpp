// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "diagnose/model.hpp"

namespace matterfit::job {

/// A recording of the corners of a cube of 20 cm whose corner at 0 is at `moved(frame, time)` [m].
template <class Moved>
diagnose::Capture flight_of_a_cube(Eigen::Index frames, double interval, const Moved& moved) {
  constexpr Eigen::Index kCorners = 8;
  diagnose::Capture capture;
  capture.name = "a";
  capture.positions.resize(3 * frames * kCorners);
  capture.use.assign(std::size_t(frames * kCorners), diagnose::Use::kUsed);
  for (Eigen::Index i = 0; i < kCorners; ++i) {
    capture.rest.push_back(0.2 * Vec3d(double(i & 1), double((i >> 1) & 1), double(i >> 2)));
  }
  for (Eigen::Index f = 0; f < frames; ++f) {
    const double t = double(f) * interval;
    const Vec3d by = moved(f, t);
    capture.times.push_back(t);
    for (Eigen::Index i = 0; i < kCorners; ++i) {
      capture.positions.segment<3>(3 * (f * kCorners + i)) = capture.rest[std::size_t(i)] + by;
    }
  }
  return capture;
}

}  // namespace matterfit::job
