// SPDX-License-Identifier: GPL-3.0-or-later
// A law chosen at run time, a point at a time: for what is not a kernel.
#pragma once

#include "material/classical/laws-inl.hpp"
#include "math/mat3_eigen-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

/// kirchhoff_stress of the law that `c` names.
template <class T>
Sym3<T> kirchhoff_stress_at(const material::LawConstants<typename LaneTraits<T>::Scalar>& c,
                            const Mat3<T>& h, T jm1, T mean_minus_one, T dt, Sym3<T>& flow,
                            T& strain) {
  return material::dispatch(material::traits(c.law).family, [&]<StressFamily kFamily>() HWY_ATTR {
    return kirchhoff_stress<kFamily, T>(c, h, jm1, mean_minus_one, dt, flow, strain);
  });
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
