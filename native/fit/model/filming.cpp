// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/filming.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "capture/particle_gaussians.hpp"
#include "fit/data/follow.hpp"
#include "fit/model/occlusion.hpp"

namespace matterfit::fit {
namespace {

constexpr double kSameFrame = 1e-6;  // frames
/// Memory to draw a particle: four frames of position and F in double, both between them, the
/// Gaussian, its footprint, and a few tiles that it touches; and to draw a pixel: the rasteriser's
/// five channels and what is handed on of them.
constexpr double kBytesAParticle = 4 * 96 + 2 * 96 + 100 + 150 + 4 * 32;
constexpr double kBytesAPixel = 2 * 5 * 4 + 4;

/// F of what flows is not how its particles moved.
bool carries_shape(const mpm::Body& body) { return !body.material.traits().fluid; }

/// Colours Gaussians of a scene's particles: `of` a body's own, the others black.
void paint(splat::Gaussians& gaussians, const mpm::Scene& scene, std::optional<std::size_t> body,
           const std::function<Vec3f(std::size_t b, std::size_t i)>& of) {
  std::vector<Vec3f> values;
  values.reserve(gaussians.size());
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const bool shown = !body || *body == b;
    for (std::size_t i = 0; i < scene.bodies[b].rest.size(); ++i) {
      values.push_back(shown ? of(b, i) : Vec3f(Vec3f::Zero()));
    }
  }
  capture::set_colours(gaussians, values);
}

/// The camera that takes images `times` finer.
splat::Camera finer(splat::Camera camera, int times) {
  camera.width *= times;
  camera.height *= times;
  for (double* value : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *value *= times;
  return camera;
}

/// Images of a camera, one behind the other, from such that are `times` finer.
std::vector<float> averaged(const std::vector<float>& fine, const splat::Camera& camera,
                            int times) {
  if (times == 1 || fine.empty()) return fine;
  const auto n = static_cast<std::size_t>(times);
  const auto width = static_cast<std::size_t>(camera.width);
  std::vector<float> result(fine.size() / (n * n), 0.0F);
  const float share = 1.0F / static_cast<float>(n * n);
  for (std::size_t i = 0; i < fine.size(); ++i) {
    const std::size_t x = i % (n * width) / n;
    const std::size_t y = i / (n * width) / n;  // rows of an image are a multiple of n
    result[y * width + x] += share * fine[i];
  }
  return result;
}

std::vector<float> first_channel(const splat::Image& image) {
  return {image.colour.begin(), image.colour.begin() + std::ptrdiff_t(image.pixels())};
}

}  // namespace

double Filming::until() const {
  double until = 0.0;
  for (const View& view : views) until = std::max(until, view.time);
  return until;
}

ParticleFilm::ParticleFilm(const mpm::Scene& scene) : scene_(scene), bodies_(scene.bodies.size()) {}

std::size_t ParticleFilm::kept() const {
  return bodies_.empty() ? 0 : bodies_.front().places.size();
}

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

bool ParticleFilm::settles(double time) const {
  const double at = time * scene_.fps;
  const double whole = std::floor(at + kSameFrame);
  // A cubic between two frames needs the one after both.
  const double needed = std::abs(at - whole) < kSameFrame ? whole + 1.0 : whole + 3.0;
  return double(frames()) >= needed;
}

void ParticleFilm::forget_before(double time) {
  const double needed = std::floor(time * scene_.fps + kSameFrame) - 1.0;
  if (needed <= double(first_)) return;
  const std::size_t count = std::min(static_cast<std::size_t>(needed) - first_, kept());
  for (OfBody& body : bodies_) {
    for (std::vector<Points>* frames : {&body.places, &body.columns}) {
      const std::size_t own = std::min(count, frames->size());
      frames->erase(frames->begin(), frames->begin() + std::ptrdiff_t(own));
    }
  }
  first_ += count;
}

splat::Gaussians ParticleFilm::at(double time, double size) const {
  std::vector<Vec3f> positions;
  std::vector<Mat3f> gradients;
  const std::vector<double> times{time - double(first_) / scene_.fps};
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const OfBody& of = bodies_[b];
    const std::size_t particles = scene_.bodies[b].rest.size();
    const Points places = at_times(of.places, particles, times, scene_.fps).positions;
    const bool inside =
        std::all_of(places.begin(), places.end(), [](const Vec3d& x) { return x.allFinite(); });
    if (!inside) return {};
    for (const Vec3d& x : places) positions.push_back(x.cast<float>());
    if (of.columns.empty()) {
      gradients.insert(gradients.end(), particles, Mat3f::Identity());
      continue;
    }
    const Points columns = at_times(of.columns, 3 * particles, times, scene_.fps).positions;
    for (std::size_t i = 0; i < particles; ++i) {
      Mat3f f;
      for (int k = 0; k < 3; ++k) f.col(k) = columns[3 * i + std::size_t(k)].cast<float>();
      gradients.push_back(f);
    }
  }
  return capture::particle_gaussians(positions, gradients, size * 0.5 * scene_.dx);
}

Filmer::Filmer(const mpm::Scene& scene, Given given, std::shared_ptr<Arena> arena,
               SimdTarget target)
    : scene_(scene),
      given_(std::move(given)),
      arena_(std::move(arena)),
      rasteriser_(arena_, target),
      film_(scene),
      open_(given_.views.size()) {
  std::iota(open_.begin(), open_.end(), std::size_t{0});
  std::stable_sort(open_.begin(), open_.end(), [&](std::size_t a, std::size_t b) {
    return given_.views[a].time < given_.views[b].time;
  });
}

double Filmer::bytes(const mpm::Scene& scene, const std::vector<View>& views) {
  double particles = 0.0;
  for (const mpm::Body& body : scene.bodies) particles += double(body.rest.size());
  double pixels = 0.0;
  for (const View& view : views) {
    pixels = std::max(
        pixels, double(view.oversample) * view.oversample * view.camera.width * view.camera.height);
  }
  return views.empty() ? 0.0 : kBytesAParticle * particles + kBytesAPixel * pixels;
}

void Filmer::record(const mpm::ObservedFrame& frame) {
  film_.record(frame);
  std::size_t done = 0;
  while (done < open_.size() && film_.settles(given_.views[open_[done]].time)) draw(open_[done++]);
  open_.erase(open_.begin(), open_.begin() + std::ptrdiff_t(done));
  if (open_.empty()) {
    film_.forget_before(double(film_.frames()) / scene_.fps);
  } else {
    film_.forget_before(given_.views[open_.front()].time);
  }
}

void Filmer::finish() {
  for (const std::size_t view : std::exchange(open_, {})) draw(view);
}

void Filmer::draw(std::size_t v) {
  const View& view = given_.views[v];
  splat::Gaussians gaussians = film_.at(view.time, view.size);
  if (gaussians.size() == 0) return;
  for (Vec3f& x : gaussians.means) x -= given_.shift.cast<float>();
  Drawn drawn;
  const bool alone = !view.body || scene_.bodies.size() == 1;
  if (!alone) {
    paint(gaussians, scene_, view.body,
          [](std::size_t, std::size_t) { return Vec3f(Vec3f::Ones()); });
  }
  const splat::Camera camera = finer(view.camera, view.oversample);
  const splat::Image& image = rasteriser_.render(gaussians, camera);
  drawn.mask = alone ? image.mask : first_channel(image);
  const std::vector<float> visible =
      visible_share(scene_, view.time, given_.shift, camera, image, *arena_);
  if (given_.colours != nullptr) {
    const auto& of = given_.colours->bodies;
    paint(gaussians, scene_, view.body,
          [&](std::size_t b, std::size_t i) { return Vec3f(of[b].known[i] * of[b].colours[i]); });
    drawn.colour = rasteriser_.render(gaussians, camera).colour;
    paint(gaussians, scene_, view.body,
          [&](std::size_t b, std::size_t i) { return Vec3f(Vec3f::Constant(of[b].known[i])); });
    drawn.known = first_channel(rasteriser_.render(gaussians, camera));
  }
  for (std::vector<float>* channels : {&drawn.mask, &drawn.colour, &drawn.known}) {
    for (std::size_t i = 0; i < (visible.empty() ? 0 : channels->size()); ++i) {
      (*channels)[i] *= visible[i % visible.size()];
    }
    *channels = averaged(*channels, view.camera, view.oversample);
  }
  given_.see(v, drawn);
}

}  // namespace matterfit::fit
