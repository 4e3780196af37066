// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/image_problem.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace matterfit::fit {
namespace {

constexpr std::size_t kStretches = 8;
/// The blur of an image that is not blurred: a pixel's own width.
constexpr double kPixel = 0.5;

/// Pixels that a blur mixes: over the squares of its weights; at least one.
double mixed(double blur) { return std::max(1.0, 4.0 * std::numbers::pi * blur * blur); }

}  // namespace

ImageProblem::ImageProblem(const Model& model, std::vector<Parameter> parameters, Parts parts,
                           double blur_pixels)
    : model_(model),
      parameters_(std::move(parameters)),
      parts_(std::move(parts)),
      blur_(blur_pixels) {
  views_.reserve(parts_.sightings.size());
  first_.reserve(parts_.sightings.size() + 1);
  std::size_t at = 0;
  for (const Sighting& sighting : parts_.sightings) {
    Coverage& matte = mattes_.emplace_back(sighting.matte);
    const std::size_t pixels = matte.values.size();
    if (compares_colours(sighting)) {
      double area = 0.0;
      for (const float value : matte.values) area += value;
      patches_ += area / mixed(blur_);
    }
    blur(matte, blur_);
    outlines_ += outline_length(matte);
    views_.push_back(sighting.view);
    first_.push_back(at);
    at += compares_colours(sighting) ? 4 * pixels : pixels;
  }
  first_.push_back(at);
}

ImageProblem::Memory ImageProblem::memory(const std::vector<Sighting>& sightings,
                                          std::size_t parameters) {
  Memory memory;
  for (const Sighting& sighting : sightings) {
    const auto pixels = double(sighting.matte.values.size());
    const double channels = sighting.has_colours() ? 4.0 : 1.0;
    // The image as it is read, as a problem keeps it, and its matte blurred.
    memory.images +=
        sizeof(float) * (2.0 * (channels * pixels + double(sighting.seen.size())) + pixels);
    if (!sighting.held_out) memory.residuals += channels * pixels;
  }
  // Two Jacobians and two residuals a parameter, of central differences; what a step tries.
  memory.slopes = sizeof(double) * memory.residuals * (4.0 * double(parameters) + 6.0);
  return memory;
}

std::vector<double> ImageProblem::physical(const Eigen::VectorXd& point) const {
  std::vector<double> values;
  values.reserve(parameters_.size());
  for (std::size_t k = 0; k < parameters_.size(); ++k) {
    values.push_back(value_within_bounds(parameters_[k], point[Eigen::Index(k)]));
  }
  return values;
}

Scope ImageProblem::scope(const Filming& filming) const {
  Scope scope;
  scope.until = parts_.window.until;
  scope.until[0] = std::max(scope.until[0], filming.until());
  scope.filming = &filming;
  if (!plan_.runs.empty()) scope.plan = &plan_;
  return scope;
}

std::vector<std::optional<Eigen::VectorXd>> ImageProblem::evaluate(
    const std::vector<Eigen::VectorXd>& points) {
  std::vector<std::vector<double>> values;
  values.reserve(points.size());
  for (const Eigen::VectorXd& point : points) values.push_back(physical(point));
  std::vector<Eigen::VectorXd> images(points.size(),
                                      Eigen::VectorXd::Zero(Eigen::Index(first_.back())));
  Filming filming;
  filming.views = views_;
  filming.colours = parts_.colours;
  filming.see = [&](std::size_t query, std::size_t v, const Drawn& drawn) {
    const auto begin = Eigen::Index(first_[v]);
    compare(v, drawn, images[query].segment(begin, Eigen::Index(first_[v + 1]) - begin));
  };
  const Evaluation evaluation = model_.evaluate(values, scope(filming));
  std::vector<std::optional<Eigen::VectorXd>> results(points.size());
  for (std::size_t p = 0; p < points.size(); ++p) {
    if (!evaluation.outcomes[p]) {
      failure_ = evaluation.failure.message;
      continue;
    }
    Eigen::VectorXd residual = std::move(images[p]);
    if (parts_.tracks != nullptr) {
      const Eigen::VectorXd more = parts_.tracks->residuals(*evaluation.outcomes[p]);
      if (!more.allFinite()) continue;
      residual.conservativeResize(residual.size() + more.size());
      residual.tail(more.size()) = more;
    }
    results[p] = std::move(residual);
  }
  count_ += static_cast<int>(points.size());
  if (simulated) simulated(count_);
  return results;
}

double ImageProblem::coverage_weight(const Sighting& sighting) const {
  return 1.0 / coverage_deviation(sighting.noise, std::hypot(blur_, kPixel));
}

double ImageProblem::colour_weight(const Sighting& sighting) const {
  return 1.0 / (sighting.colour_noise * std::sqrt(3.0 * mixed(blur_)));
}

void ImageProblem::compare(std::size_t v, const Drawn& drawn,
                           Eigen::Ref<Eigen::VectorXd> into) const {
  const Sighting& sighting = parts_.sightings[v];
  Coverage ours = seen_of(drawn.mask, sighting.matte, sighting.seen);
  blur(ours, blur_);
  const std::size_t pixels = ours.values.size();
  const double weight = coverage_weight(sighting);
  for (std::size_t i = 0; i < pixels; ++i) {
    into[Eigen::Index(i)] = weight * double(ours.values[i] - mattes_[v].values[i]);
  }
  if (!compares_colours(sighting)) return;
  const double of_colour = colour_weight(sighting);
  for (std::size_t c = 0; c < 3; ++c) {
    Coverage apart = sighting.matte;
    for (std::size_t i = 0; i < pixels; ++i) {
      apart.values[i] *=
          drawn.colour[c * pixels + i] - drawn.known[i] * sighting.colours[c].values[i];
    }
    blur(apart, blur_);
    for (std::size_t i = 0; i < pixels; ++i) {
      into[Eigen::Index((c + 1) * pixels + i)] = of_colour * double(apart.values[i]);
    }
  }
}

Drawn ImageProblem::drawn_bar(std::size_t v, const Eigen::VectorXd& weights) const {
  const Sighting& sighting = parts_.sightings[v];
  const std::size_t pixels = sighting.matte.values.size();
  // The blur is its own transpose, as black lies around the image.
  const auto blurred = [&](std::size_t channel, double weight) {
    Coverage bar = sighting.matte;
    const auto begin = Eigen::Index(first_[v] + channel * pixels);
    for (std::size_t i = 0; i < pixels; ++i) {
      bar.values[i] = static_cast<float>(weight * weights[begin + Eigen::Index(i)]);
    }
    blur(bar, blur_);
    return bar.values;
  };
  Drawn bar;
  bar.mask = seen_of(blurred(0, coverage_weight(sighting)), sighting.matte, sighting.seen).values;
  if (!compares_colours(sighting)) return bar;
  bar.colour.reserve(3 * pixels);
  bar.known.assign(pixels, 0.0F);
  for (std::size_t c = 0; c < 3; ++c) {
    const std::vector<float> apart = blurred(c + 1, colour_weight(sighting));
    for (std::size_t i = 0; i < pixels; ++i) {
      const float value = sighting.matte.values[i] * apart[i];
      bar.colour.push_back(value);
      bar.known[i] -= value * sighting.colours[c].values[i];
    }
  }
  return bar;
}

Filming ImageProblem::filming_bar(const Eigen::VectorXd& weights) const {
  Filming filming;
  filming.views = views_;
  filming.colours = parts_.colours;
  filming.bar = [this, &weights](std::size_t v) { return drawn_bar(v, weights); };
  return filming;
}

std::vector<std::vector<Points>> ImageProblem::track_bars(const Eigen::VectorXd& weights) const {
  if (parts_.tracks == nullptr) return {};
  return parts_.tracks->seen_bars(tail(weights));
}

double ImageProblem::transposed_cost() const {
  // Beside the way back of tracks: a simulation more, and views that are drawn twice.
  constexpr double kDrawing = 3.0;
  if (!model_.has_gradient()) return 0.0;
  return kDrawing + model_.gradient_cost();
}

std::optional<Eigen::VectorXd> ImageProblem::transposed(const Eigen::VectorXd& point,
                                                        const Eigen::VectorXd& weights) {
  if (!(transposed_cost() > 0.0)) return std::nullopt;
  const Filming filming = filming_bar(weights);
  const auto sum = model_.pull_back(physical(point), scope(filming), track_bars(weights));
  if (!sum) return std::nullopt;
  return natural_gradient(parameters_, point, *sum);
}

std::optional<std::vector<double>> ImageProblem::transposed_published(
    const Eigen::VectorXd& point, const Eigen::VectorXd& weights, const std::string& body) const {
  if (!(transposed_cost() > 0.0)) return std::nullopt;
  const Filming filming = filming_bar(weights);
  return model_.pull_back_published(physical(point), scope(filming), track_bars(weights), body);
}

Eigen::VectorXd ImageProblem::tail(const Eigen::VectorXd& residual) const {
  return residual.tail(residual.size() - Eigen::Index(first_.back()));
}

double ImageProblem::effective(const Eigen::VectorXd& residual) const {
  return outlines_ + patches_ +
         (parts_.tracks != nullptr ? parts_.tracks->effective(tail(residual)) : 0.0);
}

LeastSquaresState ImageProblem::as_counted(LeastSquaresState state) const {
  const auto images = Eigen::Index(first_.back());
  double observed = 0.0;
  double of_tracks = 0.0;
  for (Eigen::Index i = 0; i < state.residual.size(); ++i) {
    if (!is_observed(state, i)) continue;
    observed += 1.0;
    of_tracks += i >= images ? 1.0 : 0.0;
  }
  const double whole = effective(state.residual);
  if (!(whole > 0.0) || !(observed > 0.0)) return state;
  const double back = std::sqrt(std::max(1.0, observed / whole));
  state.residual.head(images) *= back;
  state.jacobian.topRows(images) *= back;
  if (of_tracks > 0.0) {
    const double tracks = whole - outlines_ - patches_;
    const double own = back * std::sqrt(std::min(1.0, tracks / of_tracks));
    state.residual.tail(state.residual.size() - images) *= own;
    state.jacobian.bottomRows(state.residual.size() - images) *= own;
  }
  return state;
}

ImageProblem::Misfit ImageProblem::misfit(const Eigen::VectorXd& residual) const {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  Misfit misfit{kNone, kNone, kNone};
  double outlines = 0.0;
  double colours = 0.0;
  for (std::size_t v = 0; v < mattes_.size(); ++v) {
    const auto pixels = Eigen::Index(mattes_[v].values.size());
    const auto begin = Eigen::Index(first_[v]);
    const auto end = Eigen::Index(first_[v + 1]);
    outlines += residual.segment(begin, pixels).squaredNorm();
    colours += residual.segment(begin + pixels, end - begin - pixels).squaredNorm();
  }
  if (outlines_ > 0.0) misfit.images = outlines / outlines_;
  if (patches_ > 0.0) misfit.colours = colours / patches_;
  if (parts_.tracks == nullptr) return misfit;
  const Eigen::VectorXd rest = tail(residual);
  const auto observed = double((rest.array() != 0.0).count());
  if (observed > 0.0) misfit.tracks = rest.squaredNorm() / observed;
  return misfit;
}

std::vector<std::uint32_t> ImageProblem::blocks() const {
  std::vector<std::uint32_t> result(first_.back());
  const std::size_t count = parts_.sightings.size();
  for (std::size_t v = 0; v < count; ++v) {
    const auto stretch = static_cast<std::uint32_t>(v * kStretches / count);
    std::fill(result.begin() + std::ptrdiff_t(first_[v]),
              result.begin() + std::ptrdiff_t(first_[v + 1]), stretch);
  }
  if (parts_.tracks == nullptr) return result;
  for (const std::uint32_t block : parts_.tracks->blocks()) {
    result.push_back(std::uint32_t(kStretches) + block);
  }
  return result;
}

}  // namespace matterfit::fit
