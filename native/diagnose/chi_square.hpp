// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace matterfit::diagnose {

/// ln P(χ²_freedom > x), freedom >= 1, x >= 0; exact into the far tail. Finite sums for whole
/// degrees of freedom: Abramowitz and Stegun 26.4.4 and 26.4.5.
[[nodiscard]] double log_chi_square_tail(double x, int freedom);

/// The χ² of one degree of freedom that is as improbable as `x` with `freedom` of them: makes
/// causes of several numbers comparable to those of one.
[[nodiscard]] double equivalent_of_one(double x, int freedom);

}  // namespace matterfit::diagnose
