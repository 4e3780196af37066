// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/renewed_terms.hpp"

#include <Eigen/LU>
#include <algorithm>

#include "mpm/renewed_sample.hpp"

namespace matterfit::mpm {

template <class S>
RenewedTerms<S>::RenewedTerms(const Scene& scene, const std::vector<std::size_t>& bodies) {
  terms_.reserve(bodies.size());
  for (const std::size_t index : bodies) {
    terms_.push_back(std::make_unique<BodyTerms>(scene, scene.bodies[index]));
  }
}

template <class S>
void RenewedTerms<S>::add(RenewedBody<S>& body, std::size_t member, std::size_t b,
                          const std::uint32_t* nodes, const std::vector<double>& displacement,
                          const std::vector<double>& velocity, double dx,
                          const effects::Moment& moment) const {
  const BodyTerms& terms = *terms_[member];
  if (!terms.act()) return;
  BlockField displacements;
  BlockField velocities;
  BlockField forces;
  displacements.gather(nodes, displacement.data());
  velocities.gather(nodes, velocity.data());
  forces.clear();
  const Vec3d origin = block_origin(body.coordinates()[b], dx);
  body.for_each(b, [&](std::size_t slot, const UpdatedPlace<S>& place) {
    const BlockField::Stencil stencil = block_stencil(place, dx);
    effects::MaterialPoint point = terms.point(body.store().id[slot], body.volume(slot));
    point.position = place.position(origin, dx) + displacements.at(stencil);
    point.velocity = velocities.at(stencil);
    const Vec3d force = terms.force(point, moment);
    if (!terms.stress()) {
      forces.add(stencil, force);
      return;
    }
    // −V τ G⁻ᵀ ∇w, G from the reference to now.
    const Mat3d since = Mat3d::Identity() + displacements.gradient(stencil);
    point.deformation_gradient = since * body.elastic(slot);
    const Mat3d nominal = terms.stress(point, moment) * since.inverse().transpose();
    forces.add(stencil, force, -point.volume * nominal);
  });
  forces.add_to_halo(body.halo(b));
}

template <class S>
double RenewedTerms<S>::acceleration_bound(double speed) const {
  double most = 0.0;
  for (const auto& terms : terms_) most = std::max(most, terms->acceleration_bound(speed));
  return most;
}

template class RenewedTerms<float>;
template class RenewedTerms<double>;

}  // namespace matterfit::mpm
