// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <limits>
#include <vector>

#include "fit/data/silhouette.hpp"

namespace matterfit::fit {

/// How the colours of two images agree.
struct ColourAgreement {
  double psnr_db = std::numeric_limits<double>::quiet_NaN();  ///< of a peak of 1
  /// Mean structural similarity (Wang et al. 2004): Gaussian windows of 1.5 pixels, C₁ = .01², C₂ =
  /// .03², the mean over the channels.
  double ssim = std::numeric_limits<double>::quiet_NaN();
};

/// The agreement in the pixels that `compared` marks (1: is; 0: is not); windows hold only those
/// (normalised convolution), so that what lies around a body is no part of it. All images are of
/// one size, values 0 to 1. NaN where no pixel is compared.
[[nodiscard]] ColourAgreement colour_agreement(const std::array<Coverage, 3>& one,
                                               const std::array<Coverage, 3>& other,
                                               const Coverage& compared);

}  // namespace matterfit::fit
