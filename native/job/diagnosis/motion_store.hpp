// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "diagnose/model.hpp"

namespace matterfit::job {

/// Simulated motions of an unfinished diagnosis, one file each below a folder, so that one that was
/// stopped goes on: the engine asks for the same points in the same order, and a motion that was
/// read is that which was written, to the last bit.
class MotionStore {
 public:
  /// `inputs`: hash of everything that a motion depends on beside its point.
  MotionStore(std::filesystem::path folder, std::string inputs);

  /// What was kept of a point; nothing where it was not, or its file is damaged.
  [[nodiscard]] std::optional<diagnose::Motion> find(const diagnose::Point& point) const;
  /// Throws Error(kOutput). Several threads may keep different points at once.
  void keep(const diagnose::Point& point, const diagnose::Motion& motion) const;
  /// Removes what was kept: the diagnosis is done.
  void clear() const;

 private:
  [[nodiscard]] std::filesystem::path path_of(const diagnose::Point& point) const;

  std::filesystem::path folder_;
  std::string inputs_;
};

}  // namespace matterfit::job
