// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/classical/point_law.hpp"

#include <cmath>

#include "material/classical/law_at-inl.hpp"
#include "material/classical/maxwell-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {
namespace {

/// As the updated Lagrangian kernel takes one substep of a particle.
Mat3d advance_point(const material::LawConstants<double>& c, double dt,
                    const MaxwellStep<double>* over, const Mat3d& step,
                    material::PointState& state) {
  const Mat3d trial = step * state.elastic;
  const Mat3<double> h = to_mat3(trial - Mat3d::Identity());
  const double jm1 = determinant_minus_one(h);
  Sym3<double> flow{};
  Sym3<double> tau = kirchhoff_stress_at<double>(c, h, jm1, jm1, dt, flow, state.strain);
  state.elastic = trial;
  if (c.fluid) {
    state.elastic = std::cbrt(jm1 + 1.0) * Mat3d::Identity();
  } else if (c.plastic) {
    state.elastic += trial * from_sym3(flow);
  }
  const Mat3<double> moved = to_mat3(step - Mat3d::Identity());
  if (c.damped) add_viscous_stress(c, to_mat3((step - Mat3d::Identity()) / dt), jm1, tau);
  for (std::size_t i = 0; i < c.maxwell_count; ++i) {
    double* at = state.branches[i].data();
    store_sym3(carry_maxwell<double>(over[i], moved, load_sym3<double>(at, 1), tau), at, 1);
  }
  return from_sym3(tau);
}

}  // namespace
}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

namespace matterfit::material {

PointLaw::PointLaw(const Material& material, double dt)
    : constants_(law_constants<double>(material)), dt_(dt) {
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
  return HWY_NAMESPACE::advance_point(constants_, dt_, over, step, state);
}

}  // namespace matterfit::material
