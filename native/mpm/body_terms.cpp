// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/body_terms.hpp"

#include <algorithm>
#include <numeric>
#include <span>
#include <sstream>

#include "base/error.hpp"
#include "effects/effect_type.hpp"
#include "mpm/initial_velocity.hpp"

namespace matterfit::mpm {

TermCotangents& TermCotangents::operator+=(const TermCotangents& other) {
  for (std::size_t i = 0; i < values.size(); ++i) values[i] += other.values[i];
  log_density += other.log_density;
  position += other.position;
  rest += other.rest;
  rest_turn += other.rest_turn;
  gravity += other.gravity;
  added_density += other.added_density;
  turn += other.turn;
  return *this;
}

namespace {

bool acts_on(const effects::Effect& effect, const Body& body) {
  return effect.body.empty() || effect.body == body.name;
}

double added_density(const Scene& scene, const Body& body) {
  double sum = 0.0;
  for (const effects::Effect& effect : scene.effects) {
    if (effect.type->added_density == nullptr || !acts_on(effect, body)) continue;
    sum += effect.type->added_density(effect);
  }
  return sum;
}

/// The a for which M : [ω]× = ω · a.
Vec3d axial(const Mat3d& m) { return {m(2, 1) - m(1, 2), m(0, 2) - m(2, 0), m(1, 0) - m(0, 1)}; }

}  // namespace

void add_inertia(Scene& scene) {
  for (Body& body : scene.bodies) {
    const double added = added_density(scene, body);
    if (added != 0.0) body.density += added;
  }
}

BodyTerms::BodyTerms(const Scene& scene, const Body& body)
    : scene_(scene), body_(body), added_density_(added_density(scene, body)) {
  effects::BodyFacts facts;
  facts.volume = std::accumulate(body.volumes.begin(), body.volumes.end(), 0.0);
  facts.density = body.density;
  facts.center = center_of_volume(body);
  for (const Vec3d& x : body.rest) {
    facts.radius = std::max(facts.radius, (x - facts.center).norm());
  }
  for (const Vec3d& gravity : scene.gravity.values) {
    facts.gravity = std::max(facts.gravity, gravity.norm());
  }
  for (std::size_t e = 0; e < scene.effects.size(); ++e) {
    const effects::Effect& effect = scene.effects[e];
    if (!acts_on(effect, body)) continue;
    terms_.push_back({e, values_, is_neutral(effect), effect.type->make(effect, facts)});
    values_ += effect.values.size();
    act_ = act_ || !terms_.back().neutral;
    stress_ = stress_ || terms_.back().term->has_stress();
  }
  if (body.material.correction.empty()) return;
  correction_.emplace(body.material);
  values_ += material::kCorrectionSize;
  act_ = act_ || !correction_->neutral();
  stress_ = true;
}

effects::MaterialPoint BodyTerms::point(std::uint32_t particle, double volume) const {
  effects::MaterialPoint point;
  point.particle = particle;
  point.rest = body_.rest[particle];
  point.volume = volume;
  point.mass = (body_.density - added_density_) * volume;
  return point;
}

Vec3d BodyTerms::force(const effects::MaterialPoint& point, const effects::Moment& moment) const {
  Vec3d sum = Vec3d::Zero();
  for (const Entry& entry : terms_) {
    if (!entry.neutral) sum += entry.term->force(point, moment);
  }
  return sum;
}

Mat3d BodyTerms::stress(const effects::MaterialPoint& point, const effects::Moment& moment) const {
  Mat3d sum = Mat3d::Zero();
  for (const Entry& entry : terms_) {
    if (!entry.neutral && entry.term->has_stress()) sum += entry.term->stress(point, moment);
  }
  if (correction_ && !correction_->neutral()) {
    sum += correction_->stress(point.deformation_gradient);
  }
  return sum;
}

void BodyTerms::adjoint(const effects::MaterialPoint& point, const effects::Moment& moment,
                        const Vec3d& force_bar, const Mat3d& stress_bar,
                        effects::MaterialPointBar& bar, TermCotangents& sums) const {
  effects::MaterialPointBar own;
  for (const Entry& entry : terms_) {
    double* values = sums.values.data() + entry.first;
    entry.term->force_adjoint(point, moment, force_bar, own, values);
    if (entry.term->has_stress()) {
      entry.term->stress_adjoint(point, moment, stress_bar, own, values);
    }
  }
  if (correction_) {
    correction_->stress_adjoint(point.deformation_gradient, stress_bar, own.deformation_gradient,
                                sums.values.data() + values_ - material::kCorrectionSize);
  }
  sums.log_density += body_.density * point.volume * own.mass;
  sums.added_density -= point.volume * own.mass;
  sums.position += own.position;
  sums.rest += own.rest;
  sums.rest_turn += point.rest.cross(own.rest);
  sums.gravity += own.gravity;
  sums.turn += point.position.cross(own.position) + point.velocity.cross(own.velocity) -
               force(point, moment).cross(force_bar);
  if (stress_) {
    const Mat3d& f = point.deformation_gradient;
    const Mat3d& f_bar = own.deformation_gradient;
    const Mat3d tau = stress(point, moment);
    sums.turn += axial(f_bar * f.transpose() - f.transpose() * f_bar -
                       stress_bar * tau.transpose() + tau.transpose() * stress_bar);
  }
  bar.position += own.position;
  bar.velocity += own.velocity;
  bar.rest += own.rest;
  bar.mass += own.mass;
  bar.deformation_gradient += own.deformation_gradient;
  bar.gravity += own.gravity;
}

TermCotangents BodyTerms::zero() const {
  TermCotangents sums;
  sums.values.assign(values_, 0.0);
  return sums;
}

void BodyTerms::add_to(const TermCotangents& sums, double density_bar,
                       std::vector<std::vector<double>>& effects,
                       material::MaterialGradient& material) const {
  for (const Entry& entry : terms_) {
    std::vector<double>& of_effect = effects[entry.effect];
    for (std::size_t k = 0; k < of_effect.size(); ++k) {
      of_effect[k] += sums.values[entry.first + k];
    }
    const effects::Effect& effect = scene_.effects[entry.effect];
    if (effect.type->added_density_adjoint != nullptr) {
      effect.type->added_density_adjoint(effect, density_bar + sums.added_density,
                                         of_effect.data());
    }
  }
  if (!correction_) return;
  material::add_correction_gradient(
      body_.material, std::span<const double>(sums.values).last(material::kCorrectionSize),
      material);
}

double BodyTerms::modulus_bound() const {
  double sum = 0.0;
  for (const Entry& entry : terms_) {
    if (!entry.neutral) sum += entry.term->modulus_bound();
  }
  if (correction_) sum += correction_->modulus_bound();
  return sum;
}

double BodyTerms::rate_bound(double speed) const {
  double sum = 0.0;
  for (const Entry& entry : terms_) {
    if (!entry.neutral) sum += entry.term->rate_bound(speed);
  }
  return sum;
}

void BodyTerms::check_step(double speed) const {
  const double rate = rate_bound(speed);
  if (!(scene_.dt * rate > 1.0)) return;
  std::ostringstream text;
  text << "scene.solver.dt = " << scene_.dt << " s: the drag on body '" << body_.name
       << "' takes its speed within " << 1.0 / rate
       << " s, and a longer substep would turn it around. Remove dt, so that the solver chooses, "
          "or give less than that.";
  throw_input(text.str());
}

double BodyTerms::acceleration_bound(double speed) const {
  double sum = 0.0;
  for (const Entry& entry : terms_) {
    if (!entry.neutral) sum += entry.term->acceleration_bound(speed);
  }
  return sum;
}

}  // namespace matterfit::mpm
