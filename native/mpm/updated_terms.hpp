// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "base/parallel.hpp"
#include "mpm/body_terms.hpp"
#include "mpm/updated_adjoint_kernels.hpp"
#include "mpm/updated_grid.hpp"
#include "mpm/updated_record.hpp"

namespace matterfit::mpm {

/// The terms on the updated Lagrangian bodies: impulses of their particles, added to what the grid
/// takes up, before a substep, for as long as gravity acts in it.
template <class S>
class UpdatedTerms {
 public:
  /// `bodies`: into scene.bodies, the members of the group.
  UpdatedTerms(const Scene& scene, const std::vector<std::size_t>& bodies);

  /// Some effect names a body, if only a neutral one.
  [[nodiscard]] bool any() const { return any_; }
  [[nodiscard]] const BodyTerms& of(std::size_t member) const { return *terms_[member]; }
  /// Adds the forces times `kick` [s] to the blocks' halos.
  void apply(Arena& arena, UpdatedGrid<S>& grid, const effects::Moment& moment, double kick) const;
  /// The adjoint of apply(), with the record of the substep that followed. `nodes`: cotangents of
  /// momentum and mass from which that substep started, per block of record.before [4][64]. Adds to
  /// those of the particles, of each member, and gives the sums of each.
  [[nodiscard]] std::vector<TermCotangents> back(
      Arena& arena, const UpdatedRecord<S>& record, const std::vector<S>& nodes, double dx,
      const std::vector<UpdatedParticleBar<S>*>& particles) const;

  [[nodiscard]] double acceleration_bound(double speed) const;

 private:
  std::vector<std::unique_ptr<BodyTerms>> terms_;
  bool any_ = false;
  bool act_ = false;
};

extern template class UpdatedTerms<float>;
extern template class UpdatedTerms<double>;

}  // namespace matterfit::mpm
