// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace matterfit::mpm {

/// Quadratic B-spline at the three nodes of a cell, f = x/dx − base ∈ [½, 3/2): the scalar twin of
/// the kernels' spline_weights, for what is done a particle at a time.
template <class S>
void quadratic_weights(S f, S w[3]) {
  const S a = S(1.5) - f;
  const S b = f - S(1);
  const S c = f - S(0.5);
  w[0] = S(0.5) * a * a;
  w[1] = S(0.75) - b * b;
  w[2] = S(0.5) * c * c;
}

}  // namespace matterfit::mpm
