// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/particle_colours.hpp"

#include <algorithm>
#include <memory>

#include "base/error.hpp"
#include "capture/spherical_harmonics.hpp"

namespace matterfit::fit {
namespace {

constexpr int kSweeps = 20;
/// Coverage from which on a pixel is all body.
constexpr float kWhole = 0.95F;
/// Pixels that know a particle's colour half.
constexpr float kHalfKnown = 0.5F;
/// The rasteriser cuts colours at 0, where they would have no slope.
constexpr float kDarkest = 0.01F;
/// What one image tells.
struct Shown {
  splat::Gaussians gaussians;
  splat::Camera camera;
  std::size_t begin = 0;  ///< particles of which it tells, those of all bodies in a row
  std::size_t end = 0;
  const Sighting* sighting = nullptr;
  std::vector<float> weight;  ///< one a pixel: 1 where it is all body
};

mpm::ObservedFrame frame_at_start(const mpm::Scene& start) {
  mpm::ObservedFrame frame;
  for (const mpm::Body& body : start.bodies) {
    mpm::ObservedFrame::Body& of = frame.bodies.emplace_back();
    of.positions = body.rest;
    of.deformation_gradients.assign(body.rest.size(), Mat3d::Identity());
  }
  return frame;
}

/// Adds the transpose of drawing, times an image's three channels, to each Gaussian's colour.
void spread(splat::Rasteriser& rasteriser, const Shown& shown, const splat::Image& channels,
            std::vector<Vec3f>& into) {
  splat::GaussianGradients gradients;
  rasteriser.backward(shown.gaussians, channels, gradients);
  const std::size_t stride = 3 * splat::sh_bands(shown.gaussians.sh_degree);
  for (std::size_t i = shown.begin; i < shown.end; ++i) {
    const float* of = gradients.sh.data() + stride * i;
    into[i] += Vec3f(of[0], of[1], of[2]) / capture::kShBand0;
  }
}

}  // namespace

ParticleColours learn_colours(const mpm::Scene& start, std::span<const OwnSplats> own,
                              const std::vector<Sighting>& sightings,
                              const std::shared_ptr<Arena>& arena, SimdTarget target,
                              const Interrupter& interrupter) {
  ParticleColours result;
  result.bodies.resize(start.bodies.size());
  const bool learns = std::ranges::any_of(sightings, [](const Sighting& sighting) {
    return !sighting.held_out && sighting.has_colours() && !sighting.view.by_splats;
  });
  if (!learns) {  // what is not drawn by its own splats has no known colour
    for (std::size_t b = 0; b < start.bodies.size(); ++b) {
      result.bodies[b].colours.assign(start.bodies[b].rest.size(), Vec3f::Zero());
      result.bodies[b].known.assign(start.bodies[b].rest.size(), 0.0F);
    }
    return result;
  }
  ParticleFilm film(start, own);
  film.record(frame_at_start(start));
  const std::vector<std::size_t>& first = film.begins();
  /// All Gaussians that are particles in these colours.
  const auto colour = [&](splat::Gaussians& gaussians, std::span<const Vec3f> colours) {
    film.paint(gaussians, std::nullopt, true,
               [&](std::size_t b, std::size_t i) { return colours[first[b] + i]; });
  };
  splat::Rasteriser rasteriser(arena, target);
  std::vector<Shown> all;
  std::vector<Vec3f> seen(first.back(), Vec3f::Zero());  // pixels
  Vec3f sum = Vec3f::Zero();
  float count = 0.0F;
  for (const Sighting& sighting : sightings) {
    const bool tells = !sighting.held_out && sighting.has_colours() && !sighting.view.by_splats;
    if (!tells || sighting.view.time > 0.0) continue;
    Shown shown;
    shown.sighting = &sighting;
    shown.gaussians = film.at(0.0, sighting.view.size, *arena);
    shown.camera = sighting.view.camera;
    shown.end = first.back();
    if (sighting.view.body) {
      shown.begin = first[*sighting.view.body];
      shown.end = first[*sighting.view.body + 1];
    }
    const std::vector<Vec3f> grey(first.back(), Vec3f::Constant(0.5F));
    colour(shown.gaussians, grey);
    const splat::Image& image = rasteriser.render(shown.gaussians, shown.camera, film.options());
    splat::Image channels(image.width, image.height);
    const std::size_t pixels = image.pixels();
    for (std::size_t p = 0; p < pixels; ++p) {
      const bool whole = image.mask[p] > kWhole && sighting.matte.values[p] > kWhole;
      shown.weight.push_back(whole ? 1.0F : 0.0F);
      for (std::size_t c = 0; c < 3; ++c) channels.colour[c * pixels + p] = shown.weight[p];
      if (!whole) continue;
      for (std::size_t c = 0; c < 3; ++c) sum[int(c)] += sighting.colours[c].values[p];
      count += 1.0F;
    }
    spread(rasteriser, shown, channels, seen);
    all.push_back(std::move(shown));
  }
  if (!(count > 0.0F)) {
    throw_input(
        "no image that is fitted shows the colours of the body at the scene's first frame, from "
        "which they are taken. Let the scene begin with the recording, or leave 'colours' out.");
  }
  std::vector<Vec3f> colours(first.back(), sum / count);
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    std::vector<Vec3f> step(colours.size(), Vec3f::Zero());
    for (Shown& shown : all) {
      interrupter.check();
      colour(shown.gaussians, colours);
      const splat::Image& image = rasteriser.render(shown.gaussians, shown.camera, film.options());
      const std::size_t pixels = image.pixels();
      splat::Image channels(image.width, image.height);
      for (std::size_t c = 0; c < 3; ++c) {
        for (std::size_t p = 0; p < pixels; ++p) {
          channels.colour[c * pixels + p] =
              shown.weight[p] *
              (shown.sighting->colours[c].values[p] - image.colour[c * pixels + p]);
        }
      }
      spread(rasteriser, shown, channels, step);
    }
    for (std::size_t i = 0; i < colours.size(); ++i) {
      if (!(seen[i].x() > 0.0F)) continue;
      colours[i] = (colours[i] + step[i] / seen[i].x()).cwiseMax(kDarkest).cwiseMin(1.0F);
    }
  }
  for (std::size_t b = 0; b < start.bodies.size(); ++b) {
    if (film.has_own(b)) continue;
    auto& of = result.bodies[b];
    for (std::size_t i = first[b]; i < first[b + 1]; ++i) {
      of.colours.push_back(colours[i]);
      of.known.push_back(seen[i].x() / (seen[i].x() + kHalfKnown));
    }
  }
  return result;
}

}  // namespace matterfit::fit
