// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "base/vec.hpp"
#include "mpm/updated_place.hpp"

namespace matterfit::mpm {

/// One particle of a body whose particles share a grid with others', for contact with total
/// Lagrangian bodies. Valid until the next step.
template <class S>
struct BodyPoint {
  UpdatedPlace<S> place;
  std::uint32_t body;  ///< into scene.bodies
  std::uint32_t id;    ///< particle of the body
  Vec3d position = Vec3d::Zero();
  Vec3d velocity = Vec3d::Zero();
  double volume = 0.0;  ///< at rest [m³]
  double mass = 0.0;
};

/// Bodies without a skin, as total Lagrangian ones touch them: particle by particle.
template <class S>
class ParticleBodies {
 public:
  ParticleBodies() = default;
  virtual ~ParticleBodies() = default;
  ParticleBodies(const ParticleBodies&) = delete;
  ParticleBodies& operator=(const ParticleBodies&) = delete;

  /// Particles inside a box, in storage order.
  virtual void collect(const Vec3d& low, const Vec3d& high,
                       std::vector<BodyPoint<S>>& out) const = 0;
  /// Adds a force [N] on a particle that collect() gave, over the next step, of `dt`.
  virtual void push(const BodyPoint<S>& point, const Vec3d& force, double dt) = 0;
  /// The largest speed of any particle in the last substep, at least nearly [m/s].
  [[nodiscard]] virtual double max_speed() const = 0;
  /// The largest acceleration [m/s²] that terms give to a body in the frame that began last.
  [[nodiscard]] virtual double term_acceleration() const = 0;
};

}  // namespace matterfit::mpm
