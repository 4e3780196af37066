// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/rehearsal.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/clock.hpp"
#include "base/error.hpp"
#include "job/run/bake_cost.hpp"
#include "job/run/scene_at_level.hpp"

namespace matterfit::job {
namespace {

constexpr double kRehearsed = 1500.0;  ///< particles, about
/// Ratio of the particle separations below which the job itself is run.
constexpr double kHardlyFewer = 1.2;
constexpr double kLongestFrame = 3.0;  ///< times what a rehearsal may take: it ends between frames
constexpr double kFirstSubsteps = 0.05;  ///< of the time, to see what the first ones take
/// Share of the frames done that those to come are like.
constexpr double kLatest = 0.25;

struct RehearsedFrames {
  std::vector<double> substeps;
  std::vector<double> seconds;
};

/// Σ over `count` frames, those that were not run like the latest.
double over_all_frames(const std::vector<double>& of_frames, double count) {
  const auto done = double(of_frames.size());
  const auto latest = std::max<std::ptrdiff_t>(1, std::llround(kLatest * done));
  double sum = 0.0;
  double last = 0.0;
  for (const double x : of_frames) sum += x;
  for (auto at = of_frames.end() - latest; at != of_frames.end(); ++at) last += *at;
  return sum + (count - done) * last / double(latest);
}

}  // namespace

std::optional<Rehearsal> rehearse(const Job& job, std::size_t particles, double seconds,
                                  mpm::SimdTarget target, const std::shared_ptr<Arena>& arena,
                                  const Interrupter& interrupter) {
  const double frames = double(job.scene.frames()) - 1.0;
  if (frames < 1.0) return std::nullopt;
  const double fewer = std::cbrt(double(particles) / kRehearsed);
  const double level = fewer > kHardlyFewer ? fewer : 1.0;
  try {
    const mpm::Scene scene = scene_at_level(job, level, *arena, interrupter);
    const mpm::SubstepCost first =
        mpm::Simulation(scene, arena, {target}).measure(kFirstSubsteps * seconds, interrupter);
    if (first.seconds > kLongestFrame * seconds * scene.fps * first.dt) return std::nullopt;
    mpm::Simulation simulation(scene, arena, {.target = target, .hand_over = true});
    BakeCost before;
    if (job.bakes()) {
      before = measure_bake(job, scene, simulation.state(), *arena, interrupter);
    }
    const auto begin = Clock::now();
    RehearsedFrames done;
    while (double(done.substeps.size()) < frames && seconds_since(begin) < seconds) {
      interrupter.check();
      const mpm::FrameReport report = simulation.advance(interrupter);
      done.substeps.push_back(report.substeps);
      done.seconds.push_back(report.seconds);
    }
    if (done.substeps.empty()) return std::nullopt;
    Rehearsal result;
    const double substeps = over_all_frames(done.substeps, frames);
    result.substeps = job.scene.solver.dt > 0.0 ? substeps : substeps * level;
    result.dearer = std::max(1.0, over_all_frames(done.seconds, frames) / substeps / first.seconds);
    if (job.bakes() && before.seconds > 0.0 && before.bytes > 0) {
      const BakeCost after = measure_bake(job, scene, simulation.state(), *arena, interrupter);
      result.baking = 0.5 * (before.seconds + after.seconds) / before.seconds;
      result.size = 0.5 * double(before.bytes + after.bytes) / double(before.bytes);
    }
    return result;
  } catch (const Error& error) {
    // What its own run would say is not for an estimate to say.
    if (error.kind() == ErrorKind::kCancelled) throw;
    return std::nullopt;
  }
}

}  // namespace matterfit::job
