// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/neural/isotropic_principal.hpp"

#include "material/neural/isotropic-inl.hpp"

namespace matterfit::material {
namespace {

/// Stresses at principal strains, with what their adjoint needs of them.
struct Stressed {
  const IsotropicConstants<double>& c;
  double theta;
  Vec3d dev;
  Vec3d tau;
  HWY_NAMESPACE::UnitRises<double> rise;

  Stressed(const IsotropicConstants<double>& constants, const Vec3d& strain)
      : c(constants), theta(strain.sum()), dev(strain.array() - theta / 3.0) {
    HWY_NAMESPACE::shape_stresses<double>(c, dev.data(), theta, tau.data(), rise);
    tau.array() += HWY_NAMESPACE::volume_stress<double>(c, theta, rise);
  }

  void add_adjoint(const Vec3d& tau_bar, IsotropicConstants<double>& c_bar) const {
    double dev_bar[3] = {};
    double theta_bar = 0.0;
    HWY_NAMESPACE::shape_stresses_adjoint<double>(c, dev.data(), theta, rise, tau_bar.data(),
                                                  dev_bar, theta_bar, c_bar);
    (void)HWY_NAMESPACE::volume_stress_adjoint<double>(c, theta, rise, tau_bar.sum(), c_bar);
  }
};

}  // namespace

PrincipalResponse principal_response(const IsotropicWeights& weights, const Vec3d& strain) {
  const auto c = isotropic_constants<double>(weights);
  const Stressed at(c, strain);
  PrincipalResponse out;
  out.tau = at.tau;
  for (int i = 0; i < 3; ++i) {
    IsotropicConstants<double> c_bar{};
    at.add_adjoint(Vec3d::Unit(i), c_bar);
    IsotropicWeights bar{};
    add_isotropic_weights_adjoint(weights, c_bar, bar);
    for (std::size_t k = 0; k < kIsotropicElastic; ++k) {
      out.by_weights(i, static_cast<int>(k)) = bar[k];
    }
  }
  return out;
}

Vec3d principal_stress(const IsotropicConstants<double>& c, const Vec3d& strain) {
  return Stressed(c, strain).tau;
}

void add_principal_stress_adjoint(const IsotropicConstants<double>& c, const Vec3d& strain,
                                  const Vec3d& tau_bar, IsotropicConstants<double>& c_bar) {
  Stressed(c, strain).add_adjoint(tau_bar, c_bar);
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
