// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace matterfit::fit {

/// 97.5 % of the standard normal distribution.
inline constexpr double kNormalQuantile = 1.959963984540054;

/// 97.5 % of Student's distribution with `freedom` degrees of freedom, at least 1 and not
/// necessarily whole: half a 95 % interval over an error whose noise was seen in so many. To 1e-7.
[[nodiscard]] double student_quantile(double freedom);

}  // namespace matterfit::fit
