// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "mpm/gradient.hpp"
#include "mpm/total_adjoint.hpp"
#include "mpm/total_contact_adjoint.hpp"
#include "mpm/total_group.hpp"
#include "mpm/total_terms_adjoint.hpp"

namespace matterfit::mpm {

/// The adjoint of TotalGroup's substeps: what Gradient asks of the bodies of one formulation.
template <class S>
class TotalGroupAdjoint {
 public:
  using States = std::vector<TotalMemberState<S>>;

  /// `group` is set to the states that are gone back over. `scene` with its walls.
  TotalGroupAdjoint(const Scene& scene, TotalGroup<S>& group, SimdTarget target, bool rates);

  /// Adds the cotangents of a frame; the next substep to go back over is that before it.
  void observe(Arena& arena, const FrameLoss& loss);
  /// Goes back over a substep: as each body took it, its state before, and what its particles
  /// remember of surfaces after.
  void substep(Arena& arena, const std::vector<TotalSubstep>& taken, const States& before,
               const std::vector<ContactMemories>& after);
  /// Adds what came back to the gradient of the scene, which has a place for each body and
  /// collider. Call once, at the start of the run. `observed`, of each body: Σ x × x̄ + v × v̄ of all
  /// that was observed.
  void collect(const std::vector<Vec3d>& observed, Gradient& out) const;

 private:
  struct Member {
    std::size_t index;  ///< into scene.bodies
    TotalAdjoint<S> adjoint;
    std::unique_ptr<TotalContactAdjoint<S>> contact;  ///< null where there is no collider
    std::unique_ptr<TotalTermsAdjoint<S>> terms;      ///< null where no effect names the body
    std::vector<TotalLoadsAdjoint<S>*> loads;  ///< those two, as TotalGroup::touch() has them
    TotalCotangents<S> bar;
    Vec3d observed = Vec3d::Zero();  ///< sum of the positions' cotangents
    const Body* body = nullptr;
  };
  std::vector<Member> members_;
};

extern template class TotalGroupAdjoint<float>;
extern template class TotalGroupAdjoint<double>;

}  // namespace matterfit::mpm
