// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "base/parallel.hpp"
#include "base/vec.hpp"
#include "math/simd_target.hpp"
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
  std::optional<std::size_t> body;  ///< of which the mask is; none: all of them
  double size = 0.0;                ///< standard deviation of a particle, in particle separations
  /// How many times finer it is drawn along each edge, before its pixels become means of these: the
  /// rasteriser blurs by half a pixel, which makes bodies of finer particles too fat.
  int oversample = 1;
};

/// Colours of a scene's particles, as far as a recording shows them.
struct ParticleColours {
  struct OfBody {
    std::vector<Vec3f> colours;  ///< (N) sRGB, 0 to 1
    std::vector<float> known;    ///< (N) from 0, not seen, to 1
  };
  std::vector<OfBody> bodies;
};

/// A view, drawn: what is seen of its body, or of all, behind whatever else stands before it.
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
  /// Told of every view that lies in the simulated time, by the thread of that query, in no order.
  std::function<void(std::size_t query, std::size_t view, const Drawn&)> see;

  /// The time of the last view [s].
  [[nodiscard]] double until() const;
};

/// What the particles of a scene's bodies do, recorded frame by frame, as opaque Gaussians that
/// their deformation gradients carry along, at any time between.
class ParticleFilm {
 public:
  explicit ParticleFilm(const mpm::Scene& scene);  ///< borrowed
  /// The frame has deformation gradients.
  void record(const mpm::ObservedFrame& frame);
  /// How many have been recorded.
  [[nodiscard]] std::size_t frames() const { return first_ + kept(); }
  /// Whether at() says at `time` what it will say when more is recorded.
  [[nodiscard]] bool settles(double time) const;
  /// Nothing is asked any more of what came before `time`, which takes memory.
  void forget_before(double time);
  /// At `time` [s], body after body; empty outside of what was recorded. `size` as View has it.
  [[nodiscard]] splat::Gaussians at(double time, double size) const;

 private:
  struct OfBody {
    std::vector<Points> places;   ///< one a frame that is kept
    std::vector<Points> columns;  ///< of F, three a particle; none where it is not carried
  };
  [[nodiscard]] std::size_t kept() const;

  const mpm::Scene& scene_;
  std::size_t first_ = 0;  ///< frame that is kept
  std::vector<OfBody> bodies_;
};

/// Draws views of one simulation while it goes on, and keeps no more frames than it needs.
class Filmer {
 public:
  struct Given {
    std::vector<View> views;                   ///< cameras as they stand, times of this simulation
    const ParticleColours* colours = nullptr;  ///< borrowed; null: masks alone
    Vec3d shift = Vec3d::Zero();               ///< of the whole simulation, taken off [m]
    std::function<void(std::size_t view, const Drawn&)> see;
  };
  Filmer(const mpm::Scene& scene, Given given, std::shared_ptr<Arena> arena, SimdTarget target);

  /// Draws what this frame settles. It has deformation gradients.
  void record(const mpm::ObservedFrame& frame);
  /// Draws the rest of what lies in the recorded time.
  void finish();

  /// What drawing takes in memory, about [bytes].
  [[nodiscard]] static double bytes(const mpm::Scene& scene, const std::vector<View>& views);

 private:
  void draw(std::size_t view);

  const mpm::Scene& scene_;
  Given given_;
  std::shared_ptr<Arena> arena_;
  splat::Rasteriser rasteriser_;
  ParticleFilm film_;
  std::vector<std::size_t> open_;  ///< views that are not drawn, by time
};

}  // namespace matterfit::fit
