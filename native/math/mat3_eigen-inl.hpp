// SPDX-License-Identifier: GPL-3.0-or-later
// Matrices of mat3-inl.hpp made of Eigen's, and the opposite: for what is not a kernel.
#pragma once

#include "base/vec.hpp"
#include "math/mat3-inl.hpp"

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

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
