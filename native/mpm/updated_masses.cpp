// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/updated_masses.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "mpm/updated_back.hpp"

namespace matterfit::mpm {
namespace {

/// Particles near a place, and what they are worth there.
struct Neighbourhood {
  std::vector<std::uint32_t> particles;
  std::vector<Vec3d> away;  ///< from the place [cells]
  std::vector<double> weight;
};

/// Quadratic B-spline.
double spline(double a) {
  if (a >= 1.5) return 0.0;
  return a < 0.5 ? 0.75 - a * a : 0.5 * (1.5 - a) * (1.5 - a);
}

Neighbourhood around(const Body& body, const Vec3d& place, double dx) {
  Neighbourhood out;
  for (std::size_t p = 0; p < body.rest.size(); ++p) {
    const Vec3d away = (body.rest[p] - place) / dx;
    const double w = spline(away.norm()) * body.volumes[p];
    if (!(w > 0.0)) continue;
    out.particles.push_back(static_cast<std::uint32_t>(p));
    out.away.push_back(away);
    out.weight.push_back(w);
  }
  return out;
}

/// Shares ∝ w exp(−λ·r) that minimise log Z(λ) + ½ε|λ|²: Σ share r = ελ.
std::vector<double> centred_shares(const Neighbourhood& near) {
  constexpr double kRegular = 1e-3;  // a λ for every place, also for one outside
  constexpr int kSteps = 100;
  Vec3d lambda = Vec3d::Zero();
  std::vector<double> shares(near.weight.size());
  const auto objective = [&](const Vec3d& at) {
    double sum = 0.0;
    for (std::size_t i = 0; i < shares.size(); ++i) {
      shares[i] = near.weight[i] * std::exp(-at.dot(near.away[i]));
      sum += shares[i];
    }
    for (double& share : shares) share /= sum;
    return std::log(sum) + 0.5 * kRegular * at.squaredNorm();
  };
  double value = objective(lambda);
  for (int step = 0; step < kSteps; ++step) {
    Vec3d mean = Vec3d::Zero();
    Mat3d spread = kRegular * Mat3d::Identity();
    for (std::size_t i = 0; i < shares.size(); ++i) mean += shares[i] * near.away[i];
    for (std::size_t i = 0; i < shares.size(); ++i) {
      const Vec3d d = near.away[i] - mean;
      spread += shares[i] * d * d.transpose();
    }
    const Vec3d slope = kRegular * lambda - mean;
    if (slope.norm() < 1e-12) break;
    const Vec3d move = -spread.ldlt().solve(slope);
    double length = 1.0;
    double next = objective(lambda + move);
    while (!(next <= value + 1e-4 * length * slope.dot(move)) && length > 1e-6) {
      length *= 0.5;
      next = objective(lambda + length * move);
    }
    if (!(next < value)) break;
    lambda += length * move;
    value = next;
  }
  (void)objective(lambda);
  return shares;
}

}  // namespace

CarriedMasses carried_masses(const Body& body, double dx) {
  CarriedMasses out;
  if (body.masses.empty()) return out;
  std::vector<std::vector<CarriedMass>> of_particle(body.rest.size());
  for (std::size_t k = 0; k < body.masses.size(); ++k) {
    const AttachedMass& mass = body.masses[k];
    const Neighbourhood near = around(body, mass.position, dx);
    if (near.particles.empty()) {
      throw_input("Body '" + body.name + "': attached mass " + std::to_string(k) +
                  " lies beside the body. Move its position onto the body.");
    }
    const std::vector<double> shares = centred_shares(near);
    for (std::size_t i = 0; i < shares.size(); ++i) {
      of_particle[near.particles[i]].push_back({mass.mass * shares[i], mass.attach});
    }
  }
  for (const std::vector<CarriedMass>& masses : of_particle) {
    out.first.push_back(static_cast<std::uint32_t>(out.masses.size()));
    out.masses.insert(out.masses.end(), masses.begin(), masses.end());
  }
  out.first.push_back(static_cast<std::uint32_t>(out.masses.size()));
  return out;
}

template <class S>
UpdatedMasses<S>::UpdatedMasses(const Scene& scene, const std::vector<UpdatedMember<S>>& members) {
  for (const UpdatedMember<S>& member : members) {
    carried_.push_back(carried_masses(scene.bodies[member.index], scene.dx));
  }
}

template <class S>
bool UpdatedMasses<S>::any() const {
  return std::any_of(carried_.begin(), carried_.end(),
                     [](const CarriedMasses& carried) { return !carried.masses.empty(); });
}

template <class S>
void UpdatedMasses<S>::act(UpdatedGrid<S>& grid, std::size_t b, const UpdatedMoment& moment,
                           UpdatedActsPtr* acts) const {
  using Chunk = UpdatedChunk<S>;
  for (std::size_t m = 0; m < carried_.size(); ++m) {
    const CarriedMasses& carried = carried_[m];
    if (carried.masses.empty()) continue;
    grid.blocks[b].bodies[m].for_each([&](std::size_t s, const Chunk& chunk, std::size_t l) {
      const double mass = carried.at(chunk.id[l], moment.time);
      if (!(mass > 0.0)) return;
      const UpdatedPlace<S> place = grid.place(b, s, chunk, l);
      const Vec3d velocity = particle_velocity(chunk, l);
      grid.add_affine_momentum(place, mass, velocity, grid.velocity_gradient(place));
      if (acts == nullptr) return;
      UpdatedActsOf<UpdatedCarry<S>>::add(
          *acts, {static_cast<std::uint32_t>(m), chunk.id[l], place, mass, velocity});
    });
  }
}

// Momentum m (v + G (x_I − x)) and mass m, G = Σ v_I ∇w_I.
template <class S>
void UpdatedMasses<S>::act_adjoint(Arena& /*arena*/, const UpdatedBack<S>& at,
                                   const UpdatedActs& acts, UpdatedCotangents<S>& bar,
                                   std::vector<double>& velocity_bar) const {
  for (const UpdatedCarry<S>& carry : UpdatedActsOf<UpdatedCarry<S>>::of(acts)) {
    const Vec3d f = carry.place.fraction();
    const PointStencil s(f, at.dx());
    const Mat3d gradient = at.velocity_gradient(carry.place, s);
    Vec3d v_bar = Vec3d::Zero();
    Vec3d x_bar = Vec3d::Zero();
    Mat3d gradient_bar = Mat3d::Zero();
    at.for_each_cotangent(carry.place, [&](const Vec3d& momentum, double mass, std::size_t i,
                                           std::size_t j, std::size_t k) {
      const double share = carry.mass * s.weight(i, j, k);
      const Vec3d arm = at.dx() * (stencil_node(i, j, k) - f);
      v_bar += share * momentum;
      gradient_bar += share * momentum * arm.transpose();
      const double all = momentum.dot(carry.velocity + gradient * arm) + mass;
      x_bar += carry.mass * all * s.gradient(i, j, k) - share * (gradient.transpose() * momentum);
    });
    at.velocity_gradient_adjoint(carry.place, s, gradient_bar, velocity_bar, x_bar);
    UpdatedParticleBar<S>& own = bar.bodies[carry.member].particles[carry.particle];
    add_to<S>(v_bar, own.velocity);
    add_to<S>(x_bar, own.position);
  }
}

template class UpdatedMasses<float>;
template class UpdatedMasses<double>;

}  // namespace matterfit::mpm
