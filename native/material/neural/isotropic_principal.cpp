// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/neural/isotropic_principal.hpp"

#include "material/neural/isotropic-inl.hpp"

namespace matterfit::material {

PrincipalResponse principal_response(const IsotropicWeights& weights, const Vec3d& strain) {
  const auto c = isotropic_constants<double>(weights);
  const double theta = strain.sum();
  const Vec3d dev = strain.array() - theta / 3.0;
  PrincipalResponse out;
  HWY_NAMESPACE::UnitRises<double> rise;
  HWY_NAMESPACE::shape_stresses<double>(c, dev.data(), theta, out.tau.data(), rise);
  out.tau.array() += HWY_NAMESPACE::volume_stress<double>(c, theta, rise);
  for (int i = 0; i < 3; ++i) {
    const Vec3d tau_bar = Vec3d::Unit(i);
    double dev_bar[3] = {};
    double theta_bar = 0.0;
    IsotropicConstants<double> c_bar{};
    HWY_NAMESPACE::shape_stresses_adjoint<double>(c, dev.data(), theta, rise, tau_bar.data(),
                                                  dev_bar, theta_bar, c_bar);
    (void)HWY_NAMESPACE::volume_stress_adjoint<double>(c, theta, rise, 1.0, c_bar);
    IsotropicWeights bar{};
    add_isotropic_weights_adjoint(weights, c_bar, bar);
    for (std::size_t k = 0; k < kIsotropicElastic; ++k) {
      out.by_weights(i, static_cast<int>(k)) = bar[k];
    }
  }
  return out;
}

Vec3d principal_stress(const IsotropicConstants<double>& c, const Vec3d& strain) {
  const double theta = strain.sum();
  const Vec3d dev = strain.array() - theta / 3.0;
  Vec3d tau;
  HWY_NAMESPACE::UnitRises<double> rise;
  HWY_NAMESPACE::shape_stresses<double>(c, dev.data(), theta, tau.data(), rise);
  tau.array() += HWY_NAMESPACE::volume_stress<double>(c, theta, rise);
  return tau;
}

void add_principal_stress_adjoint(const IsotropicConstants<double>& c, const Vec3d& strain,
                                  const Vec3d& tau_bar, IsotropicConstants<double>& c_bar) {
  const double theta = strain.sum();
  const Vec3d dev = strain.array() - theta / 3.0;
  Vec3d tau;
  HWY_NAMESPACE::UnitRises<double> rise;
  HWY_NAMESPACE::shape_stresses<double>(c, dev.data(), theta, tau.data(), rise);
  (void)HWY_NAMESPACE::volume_stress<double>(c, theta, rise);
  double dev_bar[3] = {};
  double theta_bar = 0.0;
  HWY_NAMESPACE::shape_stresses_adjoint<double>(c, dev.data(), theta, rise, tau_bar.data(), dev_bar,
                                                theta_bar, c_bar);
  (void)HWY_NAMESPACE::volume_stress_adjoint<double>(c, theta, rise, tau_bar.sum(), c_bar);
}

Vec3d principal_flow(const IsotropicWeights& weights, const Vec3d& trial, double dt,
                     double& plastic) {
  const auto c = isotropic_constants<double>(weights);
  const double theta = trial.sum();
  const Vec3d dev = trial.array() - theta / 3.0;
  const auto flow = HWY_NAMESPACE::isotropic_flow<double>(c, dev.norm(), theta, plastic, dt);
  plastic += std::sqrt(2.0 / 3.0) * (1.0 - flow.keep) * dev.norm();
  return flow.keep * dev.array() + flow.keep_volume * theta / 3.0;
}

}  // namespace matterfit::material
