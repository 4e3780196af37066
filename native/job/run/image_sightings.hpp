// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "fit/model/experiment.hpp"
#include "fit/model/image_problem.hpp"
#include "job/documents/document.hpp"
#include "mpm/scene.hpp"

namespace matterfit::job {

/// One image of a capture: as a fit sees it, and as it was recorded.
struct ImageSighting {
  fit::Sighting reduced;
  splat::Camera camera;  ///< of the whole image
  int oversample = 1;    ///< as fit::View has it, of the whole image
  /// By what the pixels of the image that a fit sees blur a particle more than those of the whole
  /// one [particle separations²].
  double blur = 0.0;
  fit::Silhouette matte;  ///< the same
  double frame = 0.0;     ///< of the scene
  std::string image;      ///< the file's name
  /// Matte, red, green and blue of the whole image, where it is held out and its colours are
  /// compared (FilmUse::kCompared); else empty.
  std::array<std::vector<std::uint8_t>, 4> planes;

  [[nodiscard]] fit::View whole() const;  ///< of the whole image
};

/// The recordings by images of a job.
struct LoadedFilms {
  std::vector<fit::Film> films;          ///< one a capture by images, in their order
  std::vector<std::string> paths;        ///< of each in the document: "captures[0]"
  std::vector<ImageSighting> sightings;  ///< of all, in order of time
  /// What each film's cameras see of their whole images, as capture::ImageClip has it.
  std::vector<std::vector<std::vector<std::uint8_t>>> seen;
  std::vector<std::string> warnings;  ///< what makes a fit doubtful, also among the statements

  /// Says of each sighting whether all that it shows are splats, which are drawn by the pixels of
  /// the recording, or are blurred as by these: splats are as wide in an image as its pixels blur
  /// them.
  void mark_splats(std::span<const fit::OwnSplats> own, const mpm::Scene& scene);
  /// fit::settle_sizes() of all sightings.
  void settle_sizes(const std::function<void(const fit::Filming&)>& film,
                    const std::vector<std::vector<std::uint8_t>>& moved,
                    std::vector<std::string>* faults = nullptr);
  /// Whether an image of that camera is fitted.
  [[nodiscard]] bool is_fitted(std::size_t film, std::size_t camera) const;
  /// How what is drawn of a whole image agrees with its matte, as far as its lens saw it.
  [[nodiscard]] fit::Agreement agreement(std::size_t sighting, std::vector<float> mask) const;
};

/// The purpose that films are loaded for.
enum class FilmUse : std::uint8_t {
  kFitted,      ///< some image of them is to be fitted
  kBesideMore,  ///< to be fitted beside something else
  kCompared,    ///< with ImageSighting::planes, which nobody else reads
};

/// Reads the images of a job, those outside of the scene's frames left out. They are reduced so
/// that a particle separation is about two pixels, or the image 128 pixels wide; what is drawn has
/// two pixels to a separation at least, and is reduced afterwards. What is odd and no
/// error goes into `statements`. Throws Error(kInput) beginning with the capture's path, and where
/// no image is left to fit, unless something else is fitted too or nothing is fitted at all
/// (`use`).
[[nodiscard]] LoadedFilms load_films(const Job& job, const mpm::Scene& scene, FilmUse use,
                                     std::vector<std::string>& statements,
                                     const Interrupter& interrupter);

/// The poses that are fitted: those that the job's parameters name, and of every camera that has a
/// fitted image those that its capture's `refine` asks for. Throws Error(kInput) for a camera that
/// there is not, or that has no image that is fitted.
[[nodiscard]] std::vector<fit::ParameterSpec> with_poses(const Job& job, const LoadedFilms& films,
                                                         std::vector<fit::ParameterSpec> specs);

/// Agreement of the drawn masks with the mattes, one a sighting, of those that `takes` takes: how
/// many `images`, mean `iou` and `contour_px`, the `worst`; null without any. Images that show
/// nothing on both sides are counted as `empty` alone; without others there is no `iou`.
[[nodiscard]] Json agreement_json(const std::vector<ImageSighting>& sightings,
                                  const std::vector<fit::Agreement>& agreements,
                                  const std::function<bool(const fit::Sighting&)>& takes);

/// Agreement of the drawn masks with the mattes: mean IoU and contour error [pixels], the worst
/// image; what is fitted and what is held out apart. `agreements` one a sighting.
[[nodiscard]] Json silhouettes_json(const std::vector<ImageSighting>& sightings,
                                    const std::vector<fit::Agreement>& agreements);
/// The same of each camera, with its `capture`, `camera` and the size of its particles.
[[nodiscard]] Json cameras_json(const LoadedFilms& films,
                                const std::vector<fit::Agreement>& agreements);
/// Says of each of these cameras that shows the simulation beside the matte in all of its images,
/// and of one whose images agree much less than those of the others.
void state_apart(const Json& cameras, std::vector<std::string>& statements);

}  // namespace matterfit::job
