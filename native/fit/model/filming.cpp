// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/filming.hpp"

#include <algorithm>

#include "capture/particle_gaussians.hpp"
#include "fit/data/follow.hpp"

namespace matterfit::fit {
namespace {

/// F of what flows is not how its particles moved.
bool carries_shape(const mpm::Body& body) { return !body.material.traits().fluid; }

}  // namespace

double Filming::until() const {
  double until = 0.0;
  for (const View& view : views) until = std::max(until, view.time);
  return until;
}

Drawn draw(splat::Rasteriser& rasteriser, splat::Gaussians gaussians,
           std::optional<std::size_t> body, const ParticleColours* colours,
           const splat::Camera& camera) {
  Drawn drawn;
  if (colours == nullptr) {
    drawn.mask = rasteriser.render(gaussians, camera).mask;
    return drawn;
  }
  std::vector<Vec3f> weighted;
  std::vector<Vec3f> known;
  for (std::size_t b = 0; b < colours->bodies.size(); ++b) {
    if (body && *body != b) continue;
    const ParticleColours::OfBody& of = colours->bodies[b];
    for (std::size_t i = 0; i < of.colours.size(); ++i) {
      weighted.emplace_back(of.known[i] * of.colours[i]);
      known.emplace_back(Vec3f::Constant(of.known[i]));
    }
  }
  capture::set_colours(gaussians, weighted);
  const splat::Image& image = rasteriser.render(gaussians, camera);
  drawn.mask = image.mask;
  drawn.colour = image.colour;
  capture::set_colours(gaussians, known);
  const splat::Image& again = rasteriser.render(gaussians, camera);
  drawn.known.assign(again.colour.begin(), again.colour.begin() + std::ptrdiff_t(again.pixels()));
  return drawn;
}

ParticleFilm::ParticleFilm(const mpm::Scene& scene) : scene_(scene), bodies_(scene.bodies.size()) {}

void ParticleFilm::record(const mpm::ObservedFrame& frame) {
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const mpm::ObservedFrame::Body& body = frame.bodies[b];
    bodies_[b].places.push_back(body.positions);
    if (!carries_shape(scene_.bodies[b])) continue;
    Points columns;
    columns.reserve(3 * body.deformation_gradients.size());
    for (const Mat3d& f : body.deformation_gradients) {
      for (int k = 0; k < 3; ++k) columns.emplace_back(f.col(k));
    }
    bodies_[b].columns.push_back(std::move(columns));
  }
}

splat::Gaussians ParticleFilm::at(double time, std::optional<std::size_t> body, double size) const {
  std::vector<Vec3f> positions;
  std::vector<Mat3f> gradients;
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    if (body && *body != b) continue;
    const OfBody& of = bodies_[b];
    const std::size_t particles = scene_.bodies[b].rest.size();
    const Points places = at_times(of.places, particles, {time}, scene_.fps).positions;
    const bool inside =
        std::all_of(places.begin(), places.end(), [](const Vec3d& x) { return x.allFinite(); });
    if (!inside) return {};
    for (const Vec3d& x : places) positions.push_back(x.cast<float>());
    if (of.columns.empty()) {
      gradients.insert(gradients.end(), particles, Mat3f::Identity());
      continue;
    }
    const Points columns = at_times(of.columns, 3 * particles, {time}, scene_.fps).positions;
    for (std::size_t i = 0; i < particles; ++i) {
      Mat3f f;
      for (int k = 0; k < 3; ++k) f.col(k) = columns[3 * i + std::size_t(k)].cast<float>();
      gradients.push_back(f);
    }
  }
  return capture::particle_gaussians(positions, gradients, size * 0.5 * scene_.dx);
}

}  // namespace matterfit::fit
