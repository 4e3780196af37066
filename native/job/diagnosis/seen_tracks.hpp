// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "base/error.hpp"
#include "capture/align.hpp"
#include "diagnose/model.hpp"

namespace matterfit::job {

/// A capture's samples as a search for contacts may look at them.
struct SeenTracks {
  const diagnose::Capture& capture;

  [[nodiscard]] bool used(Eigen::Index f, Eigen::Index i) const {
    return capture.use[static_cast<std::size_t>(f * capture.tracks() + i)] == diagnose::Use::kUsed;
  }
  /// Measured, held out or not.
  [[nodiscard]] bool seen(Eigen::Index f, Eigen::Index i) const {
    return capture.use[static_cast<std::size_t>(f * capture.tracks() + i)] !=
           diagnose::Use::kIgnored;
  }
  [[nodiscard]] Vec3d at(Eigen::Index f, Eigen::Index i) const {
    return capture.positions.segment<3>(3 * (f * capture.tracks() + i));
  }
};

/// Tracks that a body's placement is read of, at least.
inline constexpr std::size_t kFewestTracks = 6;

/// capture::fit_rigid, or nothing where points lie on a line: their turn is not known.
[[nodiscard]] inline std::optional<capture::RigidFit> placement_of(
    std::span<const Vec3d> rest, std::span<const Vec3d> there,
    std::span<const double> weights = {}) {
  try {
    return capture::fit_rigid(rest, there, weights);
  } catch (const Error&) {
    return std::nullopt;
  }
}

}  // namespace matterfit::job
