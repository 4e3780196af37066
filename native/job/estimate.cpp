// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "job/build_scene.hpp"
#include "job/run.hpp"

namespace matterfit::job {
namespace {

/// Particles that one thread moves through a substep in a second, in round figures of docs/
/// validation.md; a guess is all that is promised.
constexpr double kParticlesPerSecond = 8e6;
/// Fraction of dx that the fastest elastic wave crosses in a substep, as the solver settles on.
constexpr double kCourantTotal = 0.7;
constexpr double kCourantUpdated = 0.35;

std::uint64_t state_bytes(std::size_t particles) { return particles * (12 + 12 + 36); }

}  // namespace

Json estimate_job(const Job& job, const RunOptions& options) {
  Arena arena(options.threads);
  const Interrupter interrupter;
  const BuiltScene built = build_scene(job, arena, interrupter);
  const mpm::MemoryEstimate memory = mpm::Simulation::estimate(built.scene);
  double dt = 1.0 / built.scene.fps;
  for (const mpm::Body& body : built.scene.bodies) {
    const double speed = body.material.wave_speed(body.density) + body.velocity.norm();
    const bool total = body.formulation == mpm::Formulation::kTotal ||
                       (body.formulation == mpm::Formulation::kAuto && body.material.is_elastic());
    const double courant = total ? kCourantTotal : kCourantUpdated;
    if (speed > 0.0) dt = std::min(dt, courant * built.scene.dx / speed);
  }
  if (built.scene.dt > 0.0) dt = built.scene.dt;
  const double frames = double(job.scene.frames()) - 1.0;
  const double substeps = std::max(0.0, frames) * std::ceil(1.0 / (built.scene.fps * dt));
  const double limit = 1e9 * job.scene.solver.memory_limit_gb;
  Json bodies = Json::array();
  for (std::size_t b = 0; b < built.scene.bodies.size(); ++b) {
    bodies.push_back({{"name", built.scene.bodies[b].name},
                      {"particles", built.scene.bodies[b].rest.size()},
                      {"fill", built.fill_reports[b]}});
  }
  return {
      {"particles", memory.particles},
      {"bytes", memory.bytes},
      {"limit_bytes", static_cast<std::uint64_t>(limit)},
      {"fits", double(memory.bytes) <= limit},
      {"dx", built.scene.dx},
      {"dt", dt},
      {"substeps", substeps},
      {"seconds", double(memory.particles) * substeps / (kParticlesPerSecond * arena.threads())},
      {"disk_bytes", state_bytes(memory.particles) * std::uint64_t(job.scene.frames())},
      {"frames", job.scene.frames()},
      {"bodies", bodies}};
}

}  // namespace matterfit::job
