// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>

namespace matterfit::material {

/// Cotangents of LawConstants, entry by entry; T is a number or a register of them. Begin with {}.
template <class T>
struct ConstantsAdjoint {
  T lambda, mu, kappa, yield, hardening, eta, exponent, alpha, tip, alpha_tip, damping_shear,
      damping_bulk;

  /// Calls visit(entry) in a fixed order.
  template <class Visit>
  void for_each(const Visit& visit) {
    for (T* entry : entries()) visit(*entry);
  }
  ConstantsAdjoint& operator+=(ConstantsAdjoint other) {
    const auto from = other.entries();
    std::size_t i = 0;
    for (T* entry : entries()) *entry += *from[i++];
    return *this;
  }

 private:
  [[nodiscard]] std::array<T*, 12> entries() {
    return {&lambda,   &mu,    &kappa, &yield,     &hardening,     &eta,
            &exponent, &alpha, &tip,   &alpha_tip, &damping_shear, &damping_bulk};
  }
};

}  // namespace matterfit::material
