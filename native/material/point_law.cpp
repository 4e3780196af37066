// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/point_law.hpp"

#include <cmath>

#include "material/maxwell-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {
namespace {

Mat3<double> to_mat3(const Mat3d& m) {
  Mat3<double> out;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) out[i][j] = m(i, j);
  }
  return out;
}

Mat3d from_sym3(const Sym3<double>& s) {
  Mat3d out;
  out << s.xx, s.xy, s.xz, s.xy, s.yy, s.yz, s.xz, s.yz, s.zz;
  return out;
}

Sym3<double> stress_of(const material::LawConstants<double>& c, const Mat3<double>& h, double dt,
                       Sym3<double>& flow, double& strain) {
  const double jm1 = determinant_minus_one(h);
  switch (c.law) {
    case Law::kFixedCorotated:
      return kirchhoff_stress<Law::kFixedCorotated, double>(c, h, jm1, jm1, dt, flow, strain);
    case Law::kNeoHookean:
      return kirchhoff_stress<Law::kNeoHookean, double>(c, h, jm1, jm1, dt, flow, strain);
    case Law::kNewtonian:
      return kirchhoff_stress<Law::kNewtonian, double>(c, h, jm1, jm1, dt, flow, strain);
    default:
      return kirchhoff_stress<Law::kStvkHencky, double>(c, h, jm1, jm1, dt, flow, strain);
  }
}

/// As the updated Lagrangian kernel takes one substep of a particle.
Mat3d advance_point(const material::LawConstants<double>& c, double dt,
                    const MaxwellStep<double>* over, const Mat3d& step,
                    material::PointState& state) {
  const Mat3d trial = step * state.elastic;
  const Mat3<double> h = to_mat3(trial - Mat3d::Identity());
  const double jm1 = determinant_minus_one(h);
  Sym3<double> flow{};
  Sym3<double> tau = stress_of(c, h, dt, flow, state.strain);
  state.elastic = trial;
  if (c.law == Law::kNewtonian) {
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
