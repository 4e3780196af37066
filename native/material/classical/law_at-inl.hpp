// SPDX-License-Identifier: GPL-3.0-or-later
// A law chosen at run time, a point at a time: for what is not a kernel.
#pragma once

#include "base/vec.hpp"
#include "material/classical/laws-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

template <class S = double>
Mat3<S> to_mat3(const Mat3d& m) {
  Mat3<S> out;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) out[i][j] = static_cast<S>(m(i, j));
  }
  return out;
}

inline Mat3d from_sym3(const Sym3<double>& s) {
  Mat3d out;
  out << s.xx, s.xy, s.xz, s.xy, s.yy, s.yz, s.xz, s.yz, s.zz;
  return out;
}

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
