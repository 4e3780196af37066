// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "mpm/body_terms.hpp"
#include "mpm/updated_load.hpp"

namespace matterfit::mpm {

/// The terms on the updated Lagrangian bodies: impulses of their particles, added to what the grid
/// takes up, before a substep, for as long as gravity acts in it.
template <class S>
class UpdatedTerms final : public UpdatedLoad<S> {
 public:
  /// `bodies`: into scene.bodies, the members of the group.
  UpdatedTerms(const Scene& scene, const std::vector<std::size_t>& bodies);

  /// Some effect names a body, if only a neutral one.
  [[nodiscard]] bool any() const { return any_; }
  [[nodiscard]] const BodyTerms& of(std::size_t member) const { return *terms_[member]; }
  void push(Arena& arena, UpdatedGrid<S>& grid, const effects::Moment& moment,
            double kick) const override;
  [[nodiscard]] bool pushes_by_velocity() const override { return any_; }
  void push_adjoint(Arena& arena, const UpdatedRecord<S>& record, const std::vector<S>& nodes,
                    UpdatedCotangents<S>& bar) const override;

  [[nodiscard]] double acceleration_bound(double speed) const;

 private:
  double dx_;
  std::vector<std::unique_ptr<BodyTerms>> terms_;
  bool any_ = false;
  bool act_ = false;
};

extern template class UpdatedTerms<float>;
extern template class UpdatedTerms<double>;

}  // namespace matterfit::mpm
