// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "base/parallel.hpp"
#include "base/vec.hpp"
#include "mpm/observed_frame.hpp"
#include "mpm/scene.hpp"
#include "splat/camera.hpp"
#include "splat/gaussians.hpp"
#include "splat/rasteriser.hpp"

namespace matterfit::fit {

/// One image that is drawn of a run.
struct View {
  splat::Camera camera;             ///< as its file says
  std::size_t film = 0;             ///< in Run::films, which says how the camera stands
  std::size_t number = 0;           ///< of the camera in the film
  double time = 0.0;                ///< [s after the scene's first frame]
  std::optional<std::size_t> body;  ///< drawn alone; none: all of them
  double size = 0.0;                ///< standard deviation of a particle, in particle separations
};

/// Colours of a scene's particles, as far as a recording tells them.
struct ParticleColours {
  struct OfBody {
    std::vector<Vec3f> colours;  ///< (N) sRGB, 0 to 1
    std::vector<float> known;    ///< (N) from 0, not seen, to 1
  };
  std::vector<OfBody> bodies;
};

/// A view, drawn.
struct Drawn {
  std::vector<float> mask;    ///< (height, width)
  std::vector<float> colour;  ///< (3, height, width) Σ T α known colour; empty: was not asked for
  std::vector<float> known;   ///< (height, width) Σ T α known; the same
};

/// Images that are drawn of one run of each query.
struct Filming {
  std::size_t run = 0;
  std::vector<View> views;
  const ParticleColours* colours = nullptr;  ///< of that run's scene, borrowed; null: masks alone
  /// Told of every view that lies in the simulated time, by the thread of that query.
  std::function<void(std::size_t query, std::size_t view, const Drawn&)> see;

  /// The time of the last view [s].
  [[nodiscard]] double until() const;
};

/// Draws Gaussians of particles, those of one body or of all, and with `colours` (null: none)
/// theirs.
[[nodiscard]] Drawn draw(splat::Rasteriser& rasteriser, splat::Gaussians gaussians,
                         std::optional<std::size_t> body, const ParticleColours* colours,
                         const splat::Camera& camera);

/// What the particles of a scene's bodies do, recorded frame by frame, as opaque Gaussians that
/// their deformation gradients carry along, at any time between.
class ParticleFilm {
 public:
  explicit ParticleFilm(const mpm::Scene& scene);  ///< borrowed
  /// The frame has deformation gradients.
  void record(const mpm::ObservedFrame& frame);
  /// At `time` [s], of one body or of all; empty outside of what was recorded. `size` as View has
  /// it.
  [[nodiscard]] splat::Gaussians at(double time, std::optional<std::size_t> body,
                                    double size) const;

 private:
  struct OfBody {
    std::vector<Points> places;   ///< one a frame
    std::vector<Points> columns;  ///< of F, three a particle; none where it is not carried
  };
  const mpm::Scene& scene_;
  std::vector<OfBody> bodies_;
};

}  // namespace matterfit::fit
