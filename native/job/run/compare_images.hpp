// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "fit/data/colour_agreement.hpp"
#include "fit/model/filming.hpp"
#include "job/run/image_sightings.hpp"

namespace matterfit::job {

/// Compares the states of a finished simulation with a job's recordings by images.
class ImageComparison {
 public:
  /// Reads the images. What is odd and no error goes into `notes`. All is borrowed. Throws as
  /// load_films() does.
  ImageComparison(const Job& job, const mpm::Scene& scene, std::vector<std::string>& notes,
                  const Interrupter& interrupter);

  /// Draws what the states in `folder` show, and writes the overlays there that the job asks for.
  /// One object a capture (docs/formats.md, `compare.images[]`). Throws Error(kInput) as
  /// fit::settle_sizes() does.
  [[nodiscard]] Json run(const std::filesystem::path& folder, const std::shared_ptr<Arena>& arena,
                         SimdTarget target);
  /// What run() has written, relative to the folder.
  [[nodiscard]] const std::vector<std::string>& files() const { return files_; }

 private:
  /// Borrowed by run(), for its time.
  struct Stage {
    const std::filesystem::path& folder;
    const std::shared_ptr<Arena>& arena;
    SimdTarget target;
  };
  void film(const Stage& stage, const fit::Filming& filming) const;
  void settle_sizes(const Stage& stage);
  [[nodiscard]] std::vector<fit::Agreement> agreements(const Stage& stage);
  /// One for each image; NaN where it has no colours or nothing is known to be compared.
  [[nodiscard]] std::vector<fit::ColourAgreement> colour_agreements(const Stage& stage);
  void write_overlay(const Stage& stage, std::size_t sighting, const std::vector<float>& mask);

  const Job& job_;
  const mpm::Scene& scene_;
  const Interrupter& interrupter_;
  std::vector<std::string>& notes_;
  LoadedFilms films_;
  std::vector<fit::OwnSplats> own_;
  std::vector<std::string> files_;
};

}  // namespace matterfit::job
