// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/updated_member.hpp"

#include <cmath>

#include "base/error.hpp"
#include "material/neural/published_law.hpp"
#include "material/neural/published_material.hpp"
#include "mpm/initial_velocity.hpp"

namespace matterfit::mpm {

template <class S>
UpdatedMember<S> make_updated_member(const Body& body, std::size_t index,
                                     const std::vector<shape::ColliderPtr>& colliders, double dx) {
  UpdatedMember<S> m;
  m.index = index;
  m.name = body.name;
  m.material = body.material;
  m.law = material::law_constants<S>(body.material);
  m.density = body.density;
  m.particles = body.rest.size();
  m.memory.resize(colliders.empty() ? 0 : m.particles);
  m.maxwell.assign(m.particles * m.law.maxwell_count * 6, S(0));
  if (body.material.published) {
    m.published = material::joined_weights<S>(material::moved_published(body.material));
  }
  for (const shape::ColliderPtr& collider : colliders) {
    m.contacts.push_back(resolve_contact(collider->contact(), body, dx));
  }
  return m;
}

template <class S>
UpdatedStart<S> updated_start(const Body& body, std::size_t particle, double dx,
                              const Vec3d& center) {
  UpdatedStart<S> start{};
  Crosser<S>& p = start.particle;
  p.id = static_cast<std::uint32_t>(particle);
  int cell = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double x = body.rest[particle][axis] / dx;
    const double base = std::floor(x - 0.5);
    if (!(std::abs(base) < 1e8)) {
      throw_input("Body '" + body.name + "': particle " + std::to_string(particle) +
                  " is too far from the origin for this particle separation.");
    }
    const int b = static_cast<int>(base);
    start.block[axis] = b >> 2;
    cell = cell * 4 + (b & 3);
    p.f[axis] = static_cast<S>(x - base);
  }
  const Vec3d v = start_velocity(body, particle, center);
  const bool moving = !body.velocity_gradients.empty();
  const Mat3d rate = moving ? body.velocity_gradients[particle] : spin_matrix(body.spin);
  Mat3d h = Mat3d::Zero();
  if (!body.deformation_gradients.empty()) {
    h = body.deformation_gradients[particle] - Mat3d::Identity();
  }
  for (int i = 0; i < 3; ++i) {
    p.velocity[i] = static_cast<S>(v[i]);
    for (int j = 0; j < 3; ++j) {
      p.affine[3 * i + j] = static_cast<S>(rate(i, j));
      p.h[3 * i + j] = static_cast<S>(h(i, j));
    }
  }
  p.volume = static_cast<S>(body.volumes[particle]);
  p.cell = static_cast<std::uint8_t>(cell);
  return start;
}

template struct UpdatedMember<float>;
template struct UpdatedMember<double>;
template UpdatedMember<float> make_updated_member<float>(const Body&, std::size_t,
                                                         const std::vector<shape::ColliderPtr>&,
                                                         double);
template UpdatedMember<double> make_updated_member<double>(const Body&, std::size_t,
                                                           const std::vector<shape::ColliderPtr>&,
                                                           double);
template UpdatedStart<float> updated_start<float>(const Body&, std::size_t, double, const Vec3d&);
template UpdatedStart<double> updated_start<double>(const Body&, std::size_t, double, const Vec3d&);

}  // namespace matterfit::mpm
