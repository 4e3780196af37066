// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/parallel.hpp"
#include "base/vec.hpp"
#include "fit/model/own_splats.hpp"
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
  double blur = splat::RenderOptions().blur;  ///< of the finer image, as RenderOptions has it
  /// All that is shown are splats of bodies' own, with sizes and colours of their own.
  bool by_splats = false;
};

/// Colours of a scene's particles, as far as a recording shows them. A body that is drawn by splats
/// of its own has theirs, all of them known, and none here.
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
  /// For gradients (Model::pull_back()): the cotangents of what is drawn of a view, parts that have
  /// none empty. It is asked by one thread.
  std::function<Drawn(std::size_t view)> bar;

  /// The time of the last view [s].
  [[nodiscard]] double until() const;
};

/// Cotangents of the frames that a ParticleFilm has recorded.
struct FilmBars {
  struct OfBody {
    std::vector<Points> places;   ///< (N) one a frame; empty where nothing is drawn of it
    std::vector<Points> columns;  ///< of F, three a particle; the same
  };
  std::vector<OfBody> bodies;
  /// By each view's camera, as GaussianGradients::pose has it; empty where nothing was drawn.
  std::vector<std::array<double, 6>> poses;
};

/// What the particles of a scene's bodies do, recorded frame by frame, as opaque Gaussians that
/// their deformation gradients carry along, at any time between; or the splats that bodies carry in
/// place of them.
class ParticleFilm {
 public:
  /// Both are borrowed.
  explicit ParticleFilm(const mpm::Scene& scene, std::span<const OwnSplats> own = {});
  /// The frame has deformation gradients.
  void record(const mpm::ObservedFrame& frame);
  /// How many have been recorded.
  [[nodiscard]] std::size_t frames() const { return first_ + kept(); }
  /// Whether at() says at `time` what it will say when more is recorded.
  [[nodiscard]] bool settles(double time) const;
  /// Nothing is asked any more of what came before `time`, which takes memory.
  void forget_before(double time);
  /// At `time` [s], body after body; empty outside of what was recorded. `size` as View has it.
  /// Particles are black.
  [[nodiscard]] splat::Gaussians at(double time, double size, Arena& arena) const;
  /// The first Gaussian of each body, and the number of all.
  [[nodiscard]] const std::vector<std::size_t>& begins() const { return begins_; }
  /// Whether a body is drawn by splats of its own.
  [[nodiscard]] bool has_own(std::size_t body) const { return has_own_[body] != 0; }
  /// Gaussians with the colours of the particles, `of` each, those of other bodies than `body`
  /// black; splats of the body keep their own where `keep`.
  void paint(splat::Gaussians& gaussians, std::optional<std::size_t> body, bool keep,
             const std::function<Vec3f(std::size_t body, std::size_t particle)>& of) const;
  /// How the rasteriser is to draw them: antialiased where splats were trained so.
  [[nodiscard]] splat::RenderOptions options() const;
  /// The transpose of at(): adds the cotangents of all of its Gaussians at `time`, whose harmonics
  /// are of `sh_degree`, to those of `frames` frames. Where `bar` has some of harmonics, those of
  /// splats that `body`, or without one each body, has by itself count too.
  void add_bars(double time, const splat::GaussianGradients& bar, int sh_degree,
                std::optional<std::size_t> body, std::size_t frames, Arena& arena,
                FilmBars& into) const;

 private:
  struct OfBody {
    std::vector<Points> places;   ///< one a frame that is kept
    std::vector<Points> columns;  ///< of F, three a particle; none where it is not carried
  };
  /// A body's particles at a time.
  struct State {
    std::vector<Vec3f> positions;
    std::vector<Mat3f> gradients;
  };
  /// None outside of what was recorded.
  [[nodiscard]] std::optional<State> state(std::size_t body, double time) const;
  [[nodiscard]] capture::ParticleView view_of(std::size_t body, const State& state) const;
  [[nodiscard]] std::size_t kept() const;

  const mpm::Scene& scene_;
  std::span<const OwnSplats> own_;
  std::vector<std::size_t> begins_;
  std::vector<std::uint8_t> has_own_;
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
    std::span<const OwnSplats> own;  ///< borrowed
    /// Filming::bar; with it bars() is what the transpose of all views gives.
    std::function<Drawn(std::size_t view)> bar;
    std::size_t frames = 0;  ///< that will be recorded; asked for with `bar`
  };
  Filmer(const mpm::Scene& scene, Given given, std::shared_ptr<Arena> arena, SimdTarget target);

  /// Draws what this frame settles. It has deformation gradients.
  void record(const mpm::ObservedFrame& frame);
  /// Draws the rest of what lies in the recorded time.
  void finish();

  /// What drawing takes in memory, about [bytes]; `splats` of bodies' own.
  [[nodiscard]] static double bytes(const mpm::Scene& scene, const std::vector<View>& views,
                                    std::size_t splats);
  [[nodiscard]] const FilmBars& bars() const { return bars_; }

 private:
  void draw(std::size_t view);
  class Pass;

  const mpm::Scene& scene_;
  Given given_;
  std::shared_ptr<Arena> arena_;
  splat::Rasteriser rasteriser_;
  ParticleFilm film_;
  FilmBars bars_;
  std::vector<std::size_t> open_;  ///< views that are not drawn, by time
};

}  // namespace matterfit::fit
