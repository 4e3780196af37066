// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cmath>
#include <functional>
#include <span>
#include <vector>

#include "fit/model/model.hpp"
#include "fit/model/watcher.hpp"

/// What Model's own files share.
namespace matterfit::fit {

struct Model::RunModel {
  mpm::Scene scene;
  std::vector<Watcher> watchers;  ///< one a capture, as the loss looks at it
  std::vector<Points> watched;    ///< points of each, as the body was built
  std::vector<OwnSplats> own;     ///< that bodies are drawn by
};

/// What is simulated, and where and when it is looked at.
struct Model::Trial {
  Trial() = default;
  Trial(Trial&&) = default;  // a copy would look at what `moved` was copied from
  Trial& operator=(Trial&&) = default;
  Trial(const Trial&) = delete;
  Trial& operator=(const Trial&) = delete;
  ~Trial() = default;

  mpm::Scene scene;
  std::vector<Watcher> moved;  ///< of bodies that are placed anew
  std::span<const Watcher> watchers;
  Vec3d shift = Vec3d::Zero();             ///< of the whole scene, to be taken off [m]
  std::vector<std::vector<double>> times;  ///< of each capture
  std::vector<Viewing> films;              ///< of each of the run
  std::vector<double> view_times;          ///< of Filming::views; empty: none is drawn
  std::vector<OwnSplats> moved_own;        ///< of bodies that are placed anew
  std::span<const OwnSplats> own;          ///< that bodies are drawn by, where views are
  int frames = 0;                          ///< after the first
  const RunSteps* steps = nullptr;         ///< null: the solver chooses its substeps
  double finer = 1.0;                      ///< the factor of those that were chosen

  void set_substeps(double factor) {
    if (steps == nullptr) return;
    scene.substeps = multiplied(steps->substeps, factor);
    scene.renewals = steps->renewals;
  }
};

/// Who is told of one query's simulation.
struct Model::Listener {
  std::function<void()> tick;  ///< a frame is done
  std::size_t query = 0;
};

}  // namespace matterfit::fit
