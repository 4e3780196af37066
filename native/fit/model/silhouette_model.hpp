// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "fit/model/parameters.hpp"
#include "fit/model/step_plan.hpp"
#include "mpm/scene.hpp"
#include "mpm/simulation.hpp"
#include "splat/camera.hpp"
#include "splat/rasteriser.hpp"

namespace matterfit::fit {

/// One image that is drawn of a simulation.
struct SilhouetteView {
  splat::Camera camera;
  double time = 0.0;                ///< [s after the scene's first frame]
  std::optional<std::size_t> body;  ///< drawn alone; none: all of them
  double size = 0.0;                ///< standard deviation of a particle, in particle separations
};

/// A scene simulated at any values of the parameters, and its bodies' masks drawn from the
/// particles by the rasteriser. Immutable but for plan().
class SilhouetteModel {
 public:
  struct Options {
    mpm::SimdTarget target = mpm::SimdTarget::kAuto;
    int threads = 1;  ///< below 1: as many as the machine has
    double memory_limit_gb = 8.0;
  };

  /// `scene` is that of run 0 of `parameters`; those and the interrupter are borrowed.
  SilhouetteModel(mpm::Scene scene, const Parameters& parameters, const Options& options,
                  const Interrupter& interrupter);

  [[nodiscard]] const mpm::Scene& scene() const { return scene_; }
  [[nodiscard]] const Parameters& parameters() const { return parameters_; }

  /// Told of every view, in order of their time, its mask (row-major, of the camera's size).
  using Sink = std::function<void(std::size_t view, const std::vector<float>& mask)>;
  /// Simulates each of the points (physical values), side by side, and draws the views. `sinks` one
  /// a point, each called by one thread. Why a point could not be completed, empty where it was;
  /// views outside of the simulated time are not drawn. Throws Error(kCancelled).
  std::vector<std::string> draw(const std::vector<std::vector<double>>& points,
                                const std::vector<SilhouetteView>& views,
                                const std::vector<Sink>& sinks) const;

  /// From here on every run takes the substeps that the solver chooses at these values, or more
  /// where a stiffer material asks for them: small differences of the parameters would be drowned
  /// by another sequence of substeps. Throws Error(kCompute) where they cannot be simulated.
  void settle_steps(const std::vector<double>& values, double until);

 private:
  struct Motion;
  [[nodiscard]] Motion simulate(const std::vector<double>& values, double until,
                                const std::vector<double>& times,
                                const std::shared_ptr<Arena>& arena) const;
  void draw_one(const std::vector<double>& values, const std::vector<SilhouetteView>& views,
                const Sink& sink, const std::shared_ptr<Arena>& arena) const;

  mpm::Scene scene_;
  const Parameters& parameters_;
  Options options_;
  const Interrupter& interrupter_;
  StepPlan plan_;
};

}  // namespace matterfit::fit
