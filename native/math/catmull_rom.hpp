// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace matterfit {

/// The cubic of Catmull and Rom from `a` (s = 0) to `b` (s = 1), with the slopes that their
/// neighbours in time give at both; for values that can be added and scaled.
template <class T>
T catmull_rom(const T& before, const T& a, const T& b, const T& after, double s) {
  const T from = 0.5 * (b - before);
  const T to = 0.5 * (after - a);
  const T d = b - a;
  return a + s * (from + s * ((3.0 * d - 2.0 * from - to) + s * (from + to - 2.0 * d)));
}

}  // namespace matterfit
