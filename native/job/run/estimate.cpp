// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/estimate.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/clock.hpp"
#include "job/run/bake_cost.hpp"
#include "job/run/build_scene.hpp"
#include "job/run/rehearsal.hpp"
#include "mpm/scene_check.hpp"

namespace matterfit::job {
namespace {

/// Up to this many particles the solver itself is asked, for this long; beyond, building it takes
/// too long for a question, and the figures below answer.
constexpr std::size_t kMostMeasured = 300'000;
constexpr double kMeasureSeconds = 0.3;
constexpr double kRehearsalSeconds = 1.0;

/// Particles that one thread moves through a substep in a second, in round figures of docs/
/// validation.md.
constexpr double kParticlesPerSecond = 8e6;
/// Fraction of dx that the fastest elastic wave crosses in a substep, as the solver settles on.
constexpr double kCourantTotal = 0.5;
constexpr double kCourantUpdated = 0.3;

mpm::SubstepCost guess(const mpm::Scene& scene, std::size_t particles, int threads) {
  double dt = 1.0 / scene.fps;
  for (const mpm::Body& body : scene.bodies) {
    const double speed = body.material.wave_speed(body.density) + body.velocity.norm();
    const double courant = mpm::is_total(body) ? kCourantTotal : kCourantUpdated;
    if (speed > 0.0) dt = std::min(dt, courant * scene.dx / speed);
  }
  if (scene.dt > 0.0) dt = scene.dt;
  return {dt, static_cast<double>(particles) / (kParticlesPerSecond * threads)};
}

/// What writing and flushing a frame's state takes beside its simulation, on an ordinary disk [s].
constexpr double kStateSeconds = 0.01;

std::uint64_t state_bytes(std::size_t particles) { return particles * (12 + 12 + 36); }

}  // namespace

Json estimate_job(const Job& job, const RunOptions& options, bool closely) {
  const auto arena = std::make_shared<Arena>(options.threads);
  const Interrupter interrupter;
  const auto start = Clock::now();
  BuiltScene built = build_scene(job, *arena, interrupter);
  const double building = seconds_since(start);
  const mpm::MemoryEstimate memory = mpm::Simulation::estimate(built.scene);
  const double limit = 1e9 * job.scene.solver.memory_limit_gb;
  const bool fits = double(memory.bytes) <= limit;
  Json bodies = Json::array();
  for (std::size_t b = 0; b < built.scene.bodies.size(); ++b) {
    bodies.push_back({{"name", built.scene.bodies[b].name},
                      {"particles", built.scene.bodies[b].rest.size()},
                      {"fill", built.fill_reports[b]}});
  }
  mpm::SubstepCost cost = guess(built.scene, memory.particles, arena->threads());
  const double dx = built.scene.dx;
  const double fps = built.scene.fps;
  BakeCost bake;
  if (fits && memory.particles <= kMostMeasured) {
    mpm::Simulation simulation(built.scene, arena, {options.target});
    if (job.bakes()) {
      bake = measure_bake(job, built.scene, simulation.state(), *arena, interrupter);
    }
    cost = simulation.measure(kMeasureSeconds, interrupter);
  }
  const double frames = double(job.scene.frames()) - 1.0;
  double substeps = std::max(0.0, frames) * std::ceil(1.0 / (fps * cost.dt) - 1e-9);
  if (closely && fits) {
    if (const std::optional<Rehearsal> run = rehearse(job, memory.particles, kRehearsalSeconds,
                                                      options.target, arena, interrupter)) {
      substeps = std::max(substeps, std::ceil(run->substeps));
      cost.seconds *= run->dearer;
      bake.seconds *= run->baking;
      bake.bytes = static_cast<std::uint64_t>(double(bake.bytes) * run->size);
    }
  }
  return {{"particles", memory.particles},
          {"bytes", memory.bytes},
          {"limit_bytes", static_cast<std::uint64_t>(limit)},
          {"fits", fits},
          {"dx", dx},
          {"dt", cost.dt},
          {"substeps", substeps},
          {"seconds", building + substeps * cost.seconds + bake.begin +
                          (kStateSeconds + bake.seconds) * double(job.scene.frames())},
          {"bake_seconds", bake.begin + bake.seconds * double(job.scene.frames())},
          {"disk_bytes",
           (state_bytes(memory.particles) + bake.bytes) * std::uint64_t(job.scene.frames())},
          {"frames", job.scene.frames()},
          {"bodies", bodies}};
}

}  // namespace matterfit::job
