// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/image_fit_words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace matterfit::job {

std::string outlines_text(const Json& before, const Json& after) {
  std::string text;
  for (const char* key : {"fitted", "held_out"}) {
    // Null where there is none; without 'iou' where none shows anything.
    if (!before.at(key).contains("iou") || !after.at(key).contains("iou")) continue;
    text +=
        fmt::format("{}{}: IoU {:.3f} → {:.3f}", text.empty() ? "Outlines, " : "; ",
                    std::string(key) == "fitted" ? "fitted images" : "held-out images",
                    before.at(key).at("iou").get<double>(), after.at(key).at("iou").get<double>());
    const Json& pixels = after.at(key).at("contour_px");
    if (pixels.is_number()) text += fmt::format(", {:.2f} pixels apart", pixels.get<double>());
  }
  return text.empty() ? text : text + ".";
}

std::string weights_text(const fit::ImageProblem::Misfit& misfit) {
  constexpr double kApart = 3.0;
  const double images = std::sqrt(misfit.images);
  const double tracks = std::sqrt(misfit.tracks);
  const bool apart = std::max(images, tracks) > kApart * std::max(1.0, std::min(images, tracks));
  if (!apart) return "";
  return fmt::format(
      "The images are missed by {:.2g} times their noise, the tracks by {:.2g} times theirs: the "
      "{} count for too much. Give their captures a larger 'noise', or look for what they show "
      "and the scene lacks.",
      images, tracks, images > tracks ? "images" : "tracks");
}

}  // namespace matterfit::job
