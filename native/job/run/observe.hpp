// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/parallel.hpp"
#include "fit/data/follow.hpp"
#include "fit/data/ringdown.hpp"
#include "job/documents/document.hpp"
#include "job/run/capture_input.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::job {

/// Follows the captures' points and the probes of a job through a run.
class Observations {
 public:
  Observations(const Job& job, const mpm::Scene& scene,
               const std::vector<fit::CaptureInput>& captures, Arena& arena);
  ~Observations();
  Observations(const Observations&) = delete;
  Observations& operator=(const Observations&) = delete;

  /// True if there is anything to follow: otherwise record() needs not be called.
  [[nodiscard]] bool any() const { return !followers_.empty(); }
  /// Frames in order, from the scene's first.
  void record(const mpm::FrameState& state);

  /// How far the capture's farthest point lies from its body at rest [m].
  [[nodiscard]] double farthest(std::size_t capture) const;
  [[nodiscard]] fit::SimulatedCapture at_capture(std::size_t capture) const;
  /// Ring-down of the mean of the capture's points, simulated.
  [[nodiscard]] std::optional<fit::Ringdown> capture_ringdown(std::size_t capture) const;
  [[nodiscard]] std::optional<fit::Ringdown> probe_ringdown(std::size_t probe) const;
  /// The ringdown of a body that is let go, when there are neither captures nor probes.
  [[nodiscard]] std::optional<fit::Ringdown> body_ringdown() const;

  /// Writes `simulated.npz` (of several captures `simulated_NAME.npz`) and `probes.npz`; returns
  /// their paths relative to `folder`.
  [[nodiscard]] std::vector<std::string> write(const std::filesystem::path& folder) const;

 private:
  struct Follower;

  const Job& job_;
  const mpm::Scene& scene_;
  const std::vector<fit::CaptureInput>& captures_;
  Arena& arena_;
  std::vector<double> times_;
  std::vector<std::unique_ptr<Follower>> followers_;  ///< captures, then probes, then the body
};

/// Where a probe's points are: particles in the region, or, where none is, the layer of particles
/// that touches it, moved onto it. Throws Error(kInput) if the region does not touch the body.
[[nodiscard]] Points probe_points(const ProbeDoc& probe, const std::string& path,
                                  const mpm::Body& body, double separation);

/// The same of the job's probe `i`, whose body is in `scene`.
[[nodiscard]] Points probe_points(const Job& job, std::size_t i, const mpm::Scene& scene);

/// The quiet mean, drop and so on of the capture itself.
[[nodiscard]] std::optional<fit::Ringdown> measured_ringdown(const fit::CaptureInput& capture);

}  // namespace matterfit::job
