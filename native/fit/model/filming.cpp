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

/// The transpose of averaged(): each pixel's value, shared out among those that it was made of.
std::vector<float> shared_out(const std::vector<float>& coarse, const splat::Camera& camera,
                              int times) {
  if (times == 1) return coarse;
  const auto n = static_cast<std::size_t>(times);
  const auto width = static_cast<std::size_t>(camera.width);
  std::vector<float> result(coarse.size() * n * n);
  const float share = 1.0F / static_cast<float>(n * n);
  for (std::size_t i = 0; i < result.size(); ++i) {
    const std::size_t x = i % (n * width) / n;
    const std::size_t y = i / (n * width) / n;
    result[i] = share * coarse[y * width + x];
  }
  return result;
}

template <class T>
void add_each(const std::vector<T>& more, std::vector<T>& sum) {
  if (sum.empty()) {
    sum = more;
    return;
  }
  for (std::size_t i = 0; i < more.size(); ++i) sum[i] += more[i];
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

ParticleFilm::ParticleFilm(const mpm::Scene& scene, std::span<const OwnSplats> own)
    : scene_(scene),
      own_(own),
      begins_{0},
      has_own_(scene.bodies.size(), 0),
      bodies_(scene.bodies.size()) {
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    std::size_t count = 0;
    for (const OwnSplats& one : own) {
      if (one.body != b) continue;
      count += one.splats.size();
      has_own_[b] = 1;
    }
    begins_.push_back(begins_.back() + (has_own(b) ? count : scene.bodies[b].rest.size()));
  }
}

std::size_t ParticleFilm::kept() const {
  return bodies_.empty() ? 0 : bodies_.front().places.size();
}

void ParticleFilm::record(const mpm::ObservedFrame& frame) {
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const mpm::ObservedFrame::Body& body = frame.bodies[b];
    bodies_[b].places.push_back(body.positions);
    if (!capture::carries_shape(scene_.bodies[b])) continue;
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

std::optional<ParticleFilm::State> ParticleFilm::state(std::size_t body, double time) const {
  const OfBody& of = bodies_[body];
  const std::size_t particles = scene_.bodies[body].rest.size();
  const std::vector<double> times{time - double(first_) / scene_.fps};
  const Points places = at_times(of.places, particles, times, scene_.fps).positions;
  const bool inside =
      std::all_of(places.begin(), places.end(), [](const Vec3d& x) { return x.allFinite(); });
  if (!inside) return std::nullopt;
  State state;
  state.positions.reserve(particles);
  for (const Vec3d& x : places) state.positions.push_back(x.cast<float>());
  state.gradients.assign(particles, Mat3f::Identity());
  if (of.columns.empty()) return state;
  const Points columns = at_times(of.columns, 3 * particles, times, scene_.fps).positions;
  for (std::size_t i = 0; i < particles; ++i) {
    for (int k = 0; k < 3; ++k) {
      state.gradients[i].col(k) = columns[3 * i + std::size_t(k)].cast<float>();
    }
  }
  return state;
}

capture::ParticleView ParticleFilm::view_of(std::size_t body, const State& state) const {
  capture::ParticleView view;
  view.name = scene_.bodies[body].name;
  view.positions = state.positions;
  view.deformation_gradients = state.gradients;
  view.separation = 0.5 * scene_.dx;
  return view;
}

splat::Gaussians ParticleFilm::at(double time, double size, Arena& arena) const {
  splat::Gaussians all;
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const std::optional<State> state = this->state(b, time);
    if (!state) return {};
    if (!has_own(b)) {
      splat::append(all, capture::particle_gaussians(state->positions, state->gradients,
                                                     size * 0.5 * scene_.dx));
      continue;
    }
    for (const OwnSplats& one : own_) {
      if (one.body == b) splat::append(all, one.splats.at(view_of(b, *state), arena));
    }
  }
  return all;
}

void ParticleFilm::paint(splat::Gaussians& gaussians, std::optional<std::size_t> body, bool keep,
                         const std::function<Vec3f(std::size_t, std::size_t)>& of) const {
  const std::size_t stride = 3 * splat::sh_bands(gaussians.sh_degree);
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const bool shown = !body || *body == b;
    if (keep && shown && has_own(b)) continue;
    for (std::size_t i = begins_[b]; i < begins_[b + 1]; ++i) {
      const std::span<float> sh(gaussians.sh.data() + stride * i, stride);
      std::fill(sh.begin(), sh.end(), 0.0F);
      capture::set_colour(sh, shown ? of(b, i - begins_[b]) : Vec3f(Vec3f::Zero()));
    }
  }
}

splat::RenderOptions ParticleFilm::options() const {
  splat::RenderOptions options;
  options.antialiased =
      std::ranges::any_of(own_, [](const OwnSplats& one) { return one.splats.rest().antialiased; });
  return options;
}

void ParticleFilm::add_bars(double time, const splat::GaussianGradients& bar, int sh_degree,
                            std::optional<std::size_t> body, std::size_t frames, Arena& arena,
                            FilmBars& into) const {
  into.bodies.resize(bodies_.size());
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const std::size_t particles = scene_.bodies[b].rest.size();
    Points places(particles, Vec3d::Zero());
    std::vector<Mat3d> gradients(particles, Mat3d::Zero());
    if (!has_own(b)) {
      for (std::size_t i = 0; i < particles; ++i) {
        places[i] = bar.means[begins_[b] + i].cast<double>();
        gradients[i] = bar.deformation_gradients[begins_[b] + i].cast<double>();
      }
    } else if (const std::optional<State> state = this->state(b, time)) {
      const bool coloured = !bar.sh.empty() && (!body || *body == b);
      std::size_t first = begins_[b];
      for (const OwnSplats& one : own_) {
        if (one.body != b) continue;
        one.splats.add_bars(view_of(b, *state), bar, first,
                            coloured ? std::optional(sh_degree) : std::nullopt, places, gradients,
                            arena);
        first += one.splats.size();
      }
    }
    FilmBars::OfBody& of = into.bodies[b];
    of.places.resize(frames);
    add_at_time(of.places, time, scene_.fps, places);
    if (!capture::carries_shape(scene_.bodies[b])) continue;
    Points columns;
    columns.reserve(3 * particles);
    for (const Mat3d& f : gradients) {
      for (int k = 0; k < 3; ++k) columns.emplace_back(f.col(k));
    }
    of.columns.resize(frames);
    add_at_time(of.columns, time, scene_.fps, columns);
  }
}

Filmer::Filmer(const mpm::Scene& scene, Given given, std::shared_ptr<Arena> arena,
               SimdTarget target)
    : scene_(scene),
      given_(std::move(given)),
      arena_(std::move(arena)),
      rasteriser_(arena_, target),
      film_(scene, given_.own),
      open_(given_.views.size()) {
  std::iota(open_.begin(), open_.end(), std::size_t{0});
  std::stable_sort(open_.begin(), open_.end(), [&](std::size_t a, std::size_t b) {
    return given_.views[a].time < given_.views[b].time;
  });
}

double Filmer::bytes(const mpm::Scene& scene, const std::vector<View>& views, std::size_t splats) {
  auto particles = double(splats);
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

/// What one view is drawn by, pass by pass, with the way back of each.
class Filmer::Pass {
 public:
  Pass(Filmer& filmer, const View& view, std::optional<Drawn> bar)
      : filmer_(filmer),
        view_(view),
        bar_(std::move(bar)),
        camera_(finer(view.camera, view.oversample)),
        options_(filmer.film_.options()) {
    options_.blur = view.blur;
  }

  const splat::Image& render(const splat::Gaussians& gaussians) {
    return filmer_.rasteriser_.render(gaussians, camera_, options_);
  }
  void hide(const splat::Image& image) {
    visible_ = visible_share(filmer_.scene_, view_.time, filmer_.given_.shift, camera_, image,
                             *filmer_.arena_);
  }
  /// As the view has it: what is visible of it, in its own pixels.
  [[nodiscard]] std::vector<float> seen(std::vector<float> channels) const {
    return averaged(times_visible(std::move(channels)), view_.camera, view_.oversample);
  }
  /// Cotangents that back() goes back to.
  enum class Into { kMask, kColour };
  /// The way back of what was rendered last, of `part`'s cotangents: of the mask, or of as many
  /// channels of colour as it has. `own_colours`: those that the view's bodies have by themselves
  /// are what was rendered, so that their harmonics count.
  void back(const splat::Gaussians& gaussians, std::vector<float> Drawn::*part, Into into,
            bool own_colours = false) {
    if (!bar_) return;
    const std::vector<float>& coarse = (*bar_).*part;
    if (std::all_of(coarse.begin(), coarse.end(), [](float x) { return x == 0.0F; })) return;
    const std::vector<float> fine =
        times_visible(shared_out(coarse, view_.camera, view_.oversample));
    splat::Image channels(camera_.width, camera_.height);
    std::copy(fine.begin(), fine.end(),
              (into == Into::kMask ? channels.mask : channels.colour).begin());
    splat::GaussianGradients gradients;
    filmer_.rasteriser_.backward(gaussians, channels, gradients);
    add_each(gradients.means, sum_.means);
    add_each(gradients.deformation_gradients, sum_.deformation_gradients);
    if (own_colours) add_each(gradients.sh, sum_.sh);
    for (std::size_t k = 0; k < sum_.pose.size(); ++k) sum_.pose[k] += gradients.pose[k];
  }
  [[nodiscard]] const splat::GaussianGradients& sum() const { return sum_; }

 private:
  [[nodiscard]] std::vector<float> times_visible(std::vector<float> channels) const {
    for (std::size_t i = 0; i < (visible_.empty() ? 0 : channels.size()); ++i) {
      channels[i] *= visible_[i % visible_.size()];
    }
    return channels;
  }

  Filmer& filmer_;
  const View& view_;
  std::optional<Drawn> bar_;
  splat::Camera camera_;
  splat::RenderOptions options_;
  std::vector<float> visible_;
  splat::GaussianGradients sum_;
};

void Filmer::draw(std::size_t v) {
  const View& view = given_.views[v];
  const splat::Gaussians gaussians = [&] {
    splat::Gaussians at = film_.at(view.time, view.size, *arena_);
    for (Vec3f& x : at.means) x -= given_.shift.cast<float>();
    return at;
  }();
  if (gaussians.size() == 0) return;
  Pass pass(*this, view, given_.bar ? std::optional(given_.bar(v)) : std::nullopt);
  Drawn drawn;
  const bool alone = !view.body || scene_.bodies.size() == 1;
  splat::Gaussians painted = gaussians;
  if (!alone) {
    film_.paint(painted, view.body, false,
                [](std::size_t, std::size_t) { return Vec3f(Vec3f::Ones()); });
  }
  const splat::Image& image = pass.render(painted);
  pass.hide(image);
  drawn.mask = pass.seen(alone ? image.mask : first_channel(image));
  pass.back(painted, &Drawn::mask, alone ? Pass::Into::kMask : Pass::Into::kColour);
  if (given_.colours != nullptr) {
    const auto& of = given_.colours->bodies;
    painted = gaussians;
    film_.paint(painted, view.body, true, [&](std::size_t b, std::size_t i) {
      return Vec3f(of[b].known[i] * of[b].colours[i]);
    });
    drawn.colour = pass.seen(pass.render(painted).colour);
    pass.back(painted, &Drawn::colour, Pass::Into::kColour, true);
    film_.paint(painted, view.body, false, [&](std::size_t b, std::size_t i) {
      return Vec3f(Vec3f::Constant(film_.has_own(b) ? 1.0F : of[b].known[i]));
    });
    drawn.known = pass.seen(first_channel(pass.render(painted)));
    pass.back(painted, &Drawn::known, Pass::Into::kColour);
  }
  if (!pass.sum().means.empty()) {
    bars_.poses.resize(given_.views.size());
    bars_.poses[v] = pass.sum().pose;
    film_.add_bars(view.time, pass.sum(), gaussians.sh_degree, view.body, given_.frames, *arena_,
                   bars_);
  }
  if (given_.see) given_.see(v, drawn);
}

}  // namespace matterfit::fit
