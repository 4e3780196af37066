// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mpm/total_adjoint.hpp"
#include "mpm/total_terms.hpp"

namespace matterfit::mpm {

/// The adjoint of TotalTerms.
template <class S>
class TotalTermsAdjoint final : public TotalLoadsAdjoint<S> {
 public:
  TotalTermsAdjoint(const Scene& scene, const Body& body, TotalBody<S>& total);

  [[nodiscard]] const BodyTerms& terms() const { return terms_.terms(); }
  void prepare(Arena& arena, const TotalSubstep& substep, bool forces) override;
  void back(Arena& arena, const TotalSubstep& substep, const std::vector<double>& force_bar,
            TotalCotangents<S>& bar) override;
  [[nodiscard]] const TermCotangents& sums() const { return sums_; }

 private:
  /// What comes back in one block, body axes.
  struct BlockBar {
    BlockField displacement;
    BlockField velocity;
    TermCotangents sums;
    double log_density = 0.0;  ///< with that of the accelerations, f/m
  };
  void back(std::size_t block, const effects::Moment& moment, const std::vector<double>& force_bar,
            BlockBar& bar) const;

  TotalBody<S>& body_;
  TotalTerms<S> terms_;
  TermCotangents sums_;
  std::vector<BlockBar> blocks_;
};

extern template class TotalTermsAdjoint<float>;
extern template class TotalTermsAdjoint<double>;

}  // namespace matterfit::mpm
