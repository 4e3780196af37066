// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "mpm/scene.hpp"
#include "mpm/updated_load.hpp"
#include "mpm/updated_member.hpp"

namespace matterfit::mpm {

/// Part of an attached mass.
struct CarriedMass {
  double mass;    ///< [kg]
  double attach;  ///< seconds after the scene's first frame from which it is there
};

/// What each particle carries of a body's attached masses.
struct CarriedMasses {
  std::vector<std::uint32_t> first;  ///< of each particle's `masses`, and the end; empty: none
  std::vector<CarriedMass> masses;

  /// On a particle at `time` [kg].
  [[nodiscard]] double at(std::uint32_t particle, double time) const {
    double sum = 0.0;
    for (std::uint32_t i = first[particle]; i < first[particle + 1]; ++i) {
      if (time >= masses[i].attach - 1e-12) sum += masses[i].mass;
    }
    return sum;
  }
};

/// How the particles around its place share each attached mass of an updated body: by the quadratic
/// B-spline of the distance in cells of `dx` [m], tilted so that the shares' centre lies there as
/// well as positive shares can put it (local maximum entropy: Arroyo and Ortiz, Int. J. Numer.
/// Meth. Engng 65, 2006). Throws Error(kInput) for a mass that has no particle within 1½ cells.
[[nodiscard]] CarriedMasses carried_masses(const Body& body, double dx);

/// A particle that carries part of an attached mass, at the start of a substep.
template <class S>
struct UpdatedCarry {
  std::uint32_t member;
  std::uint32_t particle;
  UpdatedPlace<S> place;
  double mass;     ///< [kg]
  Vec3d velocity;  ///< [m/s]
};

/// The attached masses of a group's bodies: their momentum and mass go to the grid with those of
/// the particles that carry them. They move as these do, with the velocity gradient there.
template <class S>
class UpdatedMasses final : public UpdatedLoad<S> {
 public:
  UpdatedMasses(const Scene& scene, const std::vector<UpdatedMember<S>>& members);

  [[nodiscard]] bool any() const;
  void act(UpdatedGrid<S>& grid, std::size_t b, const UpdatedMoment& moment,
           UpdatedActsPtr* acts) const override;
  void act_adjoint(Arena& arena, const UpdatedBack<S>& at, const UpdatedActs& acts,
                   UpdatedCotangents<S>& bar, std::vector<double>& velocity_bar) const override;

 private:
  std::vector<CarriedMasses> carried_;  ///< of each member
};

extern template class UpdatedMasses<float>;
extern template class UpdatedMasses<double>;

}  // namespace matterfit::mpm
