// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "fit/model/silhouette_problem.hpp"
#include "job/documents/document.hpp"
#include "mpm/scene.hpp"

namespace matterfit::job {

/// One image of a capture: as a fit sees it, and as it was recorded.
struct ImageSighting {
  fit::Sighting reduced;
  splat::Camera camera;             ///< of the whole image
  std::vector<std::uint8_t> matte;  ///< of the whole image
  std::vector<std::uint8_t> seen;   ///< by the lens, as capture::ImageClip has it
  std::string capture;              ///< its name
  std::string image;                ///< the file's name
  int camera_number = 0;            ///< in its capture
};

/// Reads the images of a job, in order of time, those outside of the scene's frames left out. They
/// are reduced so that a particle separation is about two pixels, or the image 128 pixels wide.
/// What is odd and no error goes into `statements`. Throws Error(kInput) beginning with the
/// capture's path.
[[nodiscard]] std::vector<ImageSighting> load_sightings(const Job& job, const mpm::Scene& scene,
                                                        std::vector<std::string>& statements);

/// Agreement of the drawn masks with the mattes: mean IoU and contour error [pixels], the worst
/// image; what is fitted and what is held out apart. `agreements` one a sighting.
[[nodiscard]] Json silhouettes_json(const std::vector<ImageSighting>& sightings,
                                    const std::vector<fit::Agreement>& agreements);

}  // namespace matterfit::job
