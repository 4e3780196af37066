// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>

#include "material/neural/isotropic_weights.hpp"

namespace matterfit::material {

/// Cotangents of LawConstants, entry by entry; T is a number or a register of them. Begin with {}.
template <class T>
struct ConstantsAdjoint {
  T lambda, mu, kappa, yield, hardening, eta, exponent, alpha, tip, alpha_tip, damping_shear,
      damping_bulk;
  IsotropicConstants<T> neural;

  /// Calls visit(entry) in a fixed order.
  template <class Visit>
  void for_each(const Visit& visit) {
    for (T* entry : entries()) visit(*entry);
    neural.for_each(visit);
  }
  ConstantsAdjoint& operator+=(ConstantsAdjoint other) {
    std::array<const T*, kEntries> from;
    std::size_t i = 0;
    other.for_each([&](const T& entry) { from[i++] = &entry; });
    i = 0;
    for_each([&](T& entry) { entry += *from[i++]; });
    return *this;
  }

  static constexpr std::size_t kOwn = 12;
  static constexpr std::size_t kEntries = kOwn + kIsotropicWeights;

 private:
  [[nodiscard]] std::array<T*, kOwn> entries() {
    return {&lambda,   &mu,    &kappa, &yield,     &hardening,     &eta,
            &exponent, &alpha, &tip,   &alpha_tip, &damping_shear, &damping_bulk};
  }
};

}  // namespace matterfit::material
