// SPDX-License-Identifier: GPL-3.0-or-later
// Sums of a block's cotangents over the lanes. Included once per SIMD target.
#if defined(MATTERFIT_MPM_LANE_SUMS_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MPM_LANE_SUMS_INL_HPP
#undef MATTERFIT_MPM_LANE_SUMS_INL_HPP
#else
#define MATTERFIT_MPM_LANE_SUMS_INL_HPP
#endif

#include <array>
#include <cstddef>

#include "material/classical/maxwell_adjoint-inl.hpp"
#include "mpm/adjoint_kernels.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

/// Sum over the lanes, in their order.
template <class T>
double lane_sum(T value) {
  using S = typename LaneTraits<T>::Scalar;
  S lanes[LaneTraits<T>::kCount];
  LaneTraits<T>::store(value, lanes);
  double sum = 0.0;
  for (const S lane : lanes) sum += static_cast<double>(lane);
  return sum;
}

/// Sets `sums` to what a block's registers have gathered for the law and its Maxwell branches.
template <class T>
void sum_law_cotangents(ConstantsBar<T>& constants, const MaxwellStepBar<T>* branches,
                        std::size_t branch_count, mpm::LawCotangents& sums) {
  sums = {};
  std::array<double*, material::ConstantsAdjoint<double>::kEntries> to;
  std::size_t i = 0;
  sums.constants.for_each([&](double& entry) { to[i++] = &entry; });
  i = 0;
  constants.for_each([&](T& entry) { *to[i++] = lane_sum(entry); });
  for (std::size_t b = 0; b < branch_count; ++b) {
    sums.stiffness[b] = lane_sum(branches[b].stiffness);
    sums.relaxed[b] = lane_sum(branches[b].relaxed);
  }
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
