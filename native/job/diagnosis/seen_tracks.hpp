// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

#include "diagnose/model.hpp"

namespace matterfit::job {

/// A capture's samples as a search for contacts may look at them.
struct SeenTracks {
  const diagnose::Capture& capture;

  [[nodiscard]] bool used(Eigen::Index f, Eigen::Index i) const {
    return capture.use[static_cast<std::size_t>(f * capture.tracks() + i)] == diagnose::Use::kUsed;
  }
  [[nodiscard]] Vec3d at(Eigen::Index f, Eigen::Index i) const {
    return capture.positions.segment<3>(3 * (f * capture.tracks() + i));
  }
};

}  // namespace matterfit::job
