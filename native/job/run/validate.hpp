// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "job/documents/document.hpp"
#include "job/run/run_options.hpp"
#include "mpm/scene.hpp"

namespace matterfit::job {

/// All that can be said against a job before it runs: files that are missing or cannot be read,
/// bodies without volume, bodies that lie in each other or in a collider. Fills the bodies, and
/// reads the captures of a task that compares with them. Returns what is odd and no error. Throws
/// Error(kInput) with the JSON path or the names, Error(kCancelled).
std::vector<std::string> validate_job(const Job& job, const RunOptions& options,
                                      const Interrupter& interrupter);

/// Two bodies that lie in each other.
struct Overlap {
  std::size_t first = 0;  ///< indices of the bodies
  std::size_t second = 0;
  std::size_t particles = 0;    ///< of the second that lie in the first
  Vec3d place = Vec3d::Zero();  ///< the mean of them [m]
};

/// Pairs of which more than a hundredth of the smaller body's particles lie among the other's, with
/// some of these near by and on all sides; bodies that touch, and one in a hole of the other, have
/// none.
[[nodiscard]] std::vector<Overlap> find_overlaps(const mpm::Scene& scene);

}  // namespace matterfit::job
