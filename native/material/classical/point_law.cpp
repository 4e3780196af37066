// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/classical/point_law.hpp"

#include <cmath>

#include "material/classical/law_at-inl.hpp"
#include "material/classical/law_step-inl.hpp"
#include "material/neural/published_law.hpp"
#include "material/neural/published_material.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {
namespace {

/// A point that F ← step F takes along, its state in double.
struct DrivenPoint {
  static constexpr bool kCrushes = false;
  const material::LawConstants<double>& law;
  double dt;
  const MaxwellStep<double>* over;
  const Mat3d& step;
  material::PointState& state;

  [[nodiscard]] LawTrial<double> trial() const {
    const Mat3<double> h = to_mat3(step * state.elastic - Mat3d::Identity());
    const double jm1 = determinant_minus_one(h);
    return {h, jm1, jm1, jm1, state.strain};
  }
  template <StressFamily kFamily>
  void keep(const LawStep<double>& taken) const {
    state.strain = taken.strain;
    const Mat3d trial = step * state.elastic;
    state.elastic = trial;
    if constexpr (kFamily == StressFamily::kNewtonian) {
      state.elastic = std::cbrt(taken.trial.jm1 + 1.0) * Mat3d::Identity();
    } else if (law.plastic) {
      state.elastic += trial * from_sym3(taken.flow);
    }
  }
  [[nodiscard]] bool damped() const { return law.damped; }
  [[nodiscard]] Mat3<double> velocity_gradient() const {
    return to_mat3((step - Mat3d::Identity()) / dt);
  }
  void relax(Sym3<double>& tau) const {
    const Mat3<double> moved = to_mat3(step - Mat3d::Identity());
    for (std::size_t i = 0; i < law.maxwell_count; ++i) {
      double* at = state.branches[i].data();
      store_sym3(carry_maxwell<double>(over[i], moved, load_sym3<double>(at, 1), tau), at, 1);
    }
  }
};

Mat3d advance_point(const DrivenPoint& point) {
  return material::dispatch(
      material::traits(point.law.law).family, [&]<StressFamily kFamily>() HWY_ATTR {
        return from_sym3(law_step<kFamily, double>(point.law, point.dt, point).tau);
      });
}

/// A step of the published law, whose stress is not symmetric, with what acts beside it.
Mat3d advance_published(const DrivenPoint& point, const material::PublishedWeights& weights) {
  const LawTrial<double> trial = point.trial();
  Sym3<double> beside{};
  add_stress_beside<double>(point.law, trial, point, beside);
  const Mat3d deformed = point.step * point.state.elastic;
  return material::published_point(weights, point.dt, deformed, point.state.elastic) +
         from_sym3(beside);
}

}  // namespace
}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

namespace matterfit::material {

PointLaw::PointLaw(const Material& material, double dt)
    : constants_(law_constants<double>(material)), published_(material.published), dt_(dt) {
  HWY_NAMESPACE::MaxwellStep<double> over[kMostMaxwellBranches] = {};
  HWY_NAMESPACE::maxwell_steps(constants_, dt, over);
  for (std::size_t i = 0; i < constants_.maxwell_count; ++i) {
    stiffness_[i] = over[i].stiffness;
    relaxed_[i] = over[i].relaxed;
  }
}

Mat3d PointLaw::advance(const Mat3d& step, PointState& state) const {
  HWY_NAMESPACE::MaxwellStep<double> over[kMostMaxwellBranches];
  for (std::size_t i = 0; i < constants_.maxwell_count; ++i) {
    over[i] = {stiffness_[i], relaxed_[i]};
  }
  const HWY_NAMESPACE::DrivenPoint point{constants_, dt_, over, step, state};
  if (published_) return HWY_NAMESPACE::advance_published(point, published_->weights);
  return HWY_NAMESPACE::advance_point(point);
}

}  // namespace matterfit::material
