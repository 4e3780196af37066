// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/simulation.hpp"

#include <utility>

#include "base/clock.hpp"
#include "mpm/scene_check.hpp"
#include "mpm/stepper.hpp"

namespace matterfit::mpm {

struct Simulation::Impl {
  std::shared_ptr<Arena> arena;
  Stepper<float> stepper;
};

Simulation::Simulation(Scene scene, std::shared_ptr<Arena> arena, Options options)
    : impl_(new Impl{arena, {std::move(scene), arena, options}}) {}
Simulation::Simulation(Scene scene, std::shared_ptr<Arena> arena)
    : Simulation(std::move(scene), std::move(arena), Options{}) {}
Simulation::~Simulation() = default;

const Scene& Simulation::scene() const { return impl_->stepper.scene(); }
int Simulation::frame() const { return impl_->stepper.frame(); }

FrameReport Simulation::advance(const Interrupter& interrupter) {
  const auto begin = Clock::now();
  FrameReport report;
  impl_->arena->execute([&] { report = impl_->stepper.advance(interrupter); });
  report.seconds = seconds_since(begin);
  return report;
}

SubstepCost Simulation::measure(double seconds, const Interrupter& interrupter) {
  SubstepCost cost;
  impl_->arena->execute([&] { cost = impl_->stepper.measure(seconds, interrupter); });
  return cost;
}

void Simulation::change(std::size_t body, const RigidChange& change) {
  impl_->stepper.change(body, change);
}

FrameState Simulation::state() const { return impl_->stepper.state(); }
ObservedFrame Simulation::observe(bool deformation_gradients) const {
  return impl_->stepper.observe(deformation_gradients);
}
std::string Simulation::save() const { return impl_->stepper.save(); }
void Simulation::load(const std::string& bytes) { impl_->stepper.load(bytes); }

MemoryEstimate Simulation::estimate(const Scene& scene) {
  MemoryEstimate out;
  for (const Body& body : scene.bodies) {
    out.particles += body.rest.size();
    // Scene (rest, volumes), solver state with padding of partly filled lanes, one frame's output
    // and one saved state: measured with 1 M particles, rounded up.
    const std::size_t branch = is_total(body) ? 12 * sizeof(float) : 6 * sizeof(float);
    out.bytes += body.rest.size() * ((is_total(body) ? std::size_t{340} : std::size_t{520}) +
                                     branch * body.material.maxwell.size());
  }
  return out;
}

}  // namespace matterfit::mpm
