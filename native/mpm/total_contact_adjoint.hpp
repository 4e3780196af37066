// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>
#include <vector>

#include "mpm/collider_adjoint.hpp"
#include "mpm/contact_law_adjoint.hpp"
#include "mpm/total_adjoint.hpp"
#include "mpm/total_contact.hpp"

namespace matterfit::mpm {

/// The adjoint of TotalContact's forces on a body. How a collider's normal and velocity change from
/// place to place is taken from differences of the exact distance, a few more queries for each
/// particle that touches.
template <class S>
class TotalContactAdjoint final : public TotalLoadsAdjoint<S> {
 public:
  TotalContactAdjoint(const Body& body, const Scene& scene, TotalBody<S>& total);

  /// What is remembered before the next substep to go back over.
  void set_memory(std::vector<std::pair<std::uint32_t, ContactMemory>> memory);
  void prepare(const TotalSubstep& substep) override;
  void back(const TotalSubstep& substep, const std::vector<double>& force_bar,
            TotalCotangents<S>& bar) override;
  [[nodiscard]] const std::vector<ColliderCotangents>& colliders() const { return bars_; }

 private:
  /// One particle at one collider, as the forward pass met it.
  struct Touch {
    std::uint32_t particle;
    std::size_t collider;
    ContactMemory memory;  ///< before
    Vec3d center_normal;   ///< of the collider at the particle's centre
    Mat3d f;
    Vec3d face;  ///< its offset at rest, world axes
    SurfacePoint below;
    ContactPoint point;
    Vec3d force;
  };
  void back(const Touch& touch, const TotalSubstep& substep, const std::vector<double>& force_bar,
            TotalCotangents<S>& bar);
  /// The cotangents of normal and velocity of the surface met at `x`: returns that of x.
  Vec3d back_to_surface(std::size_t collider, const Vec3d& x, const SurfacePoint& at,
                        double distance_bar, const Vec3d& normal_bar, const Vec3d& velocity_bar,
                        double time);

  TotalBody<S>& body_;
  double density_;
  double probe_;  ///< of the differences [m]
  std::vector<ColliderPtr> colliders_;
  std::vector<ContactLaw> laws_;
  std::vector<ColliderCotangents> bars_;
  std::vector<ContactMemory> memory_;  ///< before the substep, per particle
  std::vector<Vec3d> stretch_bar_;     ///< per particle
  std::vector<Touch> touches_;
};

extern template class TotalContactAdjoint<float>;
extern template class TotalContactAdjoint<double>;

}  // namespace matterfit::mpm
