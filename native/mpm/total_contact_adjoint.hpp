// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>
#include <vector>

#include "mpm/contact_law_adjoint.hpp"
#include "mpm/total_adjoint.hpp"
#include "mpm/total_block.hpp"
#include "mpm/total_contact.hpp"
#include "shape/collider_adjoint.hpp"

namespace matterfit::mpm {

/// The adjoint of TotalContact's forces on a body. How a collider's normal and velocity change from
/// place to place is taken from differences of the exact distance, a few more queries for each
/// particle that touches.
template <class S>
class TotalContactAdjoint final : public TotalLoadsAdjoint<S> {
 public:
  TotalContactAdjoint(const Body& body, const Scene& scene, TotalBody<S>& total);

  /// What particles remember before and after the next substep to go back over
  /// (ContactState::memory): only they can have met a surface in it.
  void set_memory(const ContactMemories& before, const ContactMemories& after);
  void prepare(Arena& arena, const TotalSubstep& substep, bool forces) override;
  void back(Arena& arena, const TotalSubstep& substep, const std::vector<double>& force_bar,
            TotalCotangents<S>& bar) override;
  [[nodiscard]] const std::vector<shape::ColliderCotangents>& colliders() const { return bars_; }

 private:
  using Place = typename TotalBody<S>::Place;
  /// A particle that can have met a surface.
  struct Particle {
    std::uint32_t particle;
    ContactMemory memory;  ///< before
    Place center;
    Vec3d position = Vec3d::Zero();
    Mat3d f = Mat3d::Identity();
  };
  /// One particle at one collider, as the forward pass met it.
  struct Touch {
    std::size_t particle;  ///< into the group's
    std::size_t collider;
    ContactMemory memory;  ///< before
    Vec3d center_normal;   ///< of the collider at the particle's centre
    Place face;
    Vec3d face_position = Vec3d::Zero();
    shape::SurfacePoint below{};
    ContactPoint point{};
    Vec3d force = Vec3d::Zero();
  };
  /// What comes back through a touch, body axes: of the places of the particle's face and centre,
  /// of the face's velocity and of F.
  struct TouchBar {
    bool any = false;
    Vec3d face = Vec3d::Zero();
    Vec3d face_velocity = Vec3d::Zero();
    Vec3d center = Vec3d::Zero();
    Mat3d f = Mat3d::Zero();
    double log_density = 0.0;
    shape::ColliderCotangents collider;
  };
  /// The particles of one block.
  struct Group {
    std::size_t block = 0;
    std::vector<Particle> particles;  ///< ascending
    std::vector<Touch> touches;       ///< particle by particle
    std::vector<TouchBar> bars;       ///< one each
    BlockField displacement_bar;
    BlockField velocity_bar;
  };
  void meet(Group& group, const TotalSubstep& substep) const;
  void back(Group& group, const TotalSubstep& substep, const std::vector<double>& force_bar);
  [[nodiscard]] TouchBar back(const Particle& particle, const Touch& touch,
                              const TotalSubstep& substep, const TotalBlock<S>& block,
                              const BlockField& block_force_bar,
                              const std::vector<double>& force_bar, Vec3d& stretch_bar) const;
  /// The groups' displacement_bar and velocity_bar, and those of faces in other blocks.
  void add_to(Arena& arena, TotalCotangents<S>& bar) const;
  /// The cotangents of normal and velocity of the surface met at `x`: returns that of x.
  Vec3d back_to_surface(std::size_t collider, const Vec3d& x, const shape::SurfacePoint& at,
                        double distance_bar, const Vec3d& normal_bar, const Vec3d& velocity_bar,
                        double time, shape::ColliderCotangents& own) const;

  TotalBody<S>& body_;
  double density_;
  double probe_;  ///< of the differences [m]
  std::vector<shape::ColliderPtr> colliders_;
  std::vector<ContactLaw> laws_;
  std::vector<shape::ColliderCotangents> bars_;
  std::vector<Vec3d> stretch_bar_;  ///< per particle
  std::vector<Group> groups_;       ///< the first group_count_ are of this substep
  std::size_t group_count_ = 0;
  std::vector<std::uint32_t> group_of_;  ///< of a block, or kNoBlock
};

extern template class TotalContactAdjoint<float>;
extern template class TotalContactAdjoint<double>;

}  // namespace matterfit::mpm
