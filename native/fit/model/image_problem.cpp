// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/image_problem.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace matterfit::fit {
namespace {

constexpr std::size_t kStretches = 8;
/// Of what is not blurred: a pixel's own width.
constexpr double kPixel = 0.5;

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
  for (Sighting& sighting : parts_.sightings) {
    blur(sighting.matte, blur_);
    outlines_ += outline_length(sighting.matte);
    views_.push_back(sighting.view);
    first_.push_back(at);
    at += sighting.matte.values.size();
  }
  first_.push_back(at);
}

std::vector<double> ImageProblem::physical(const Eigen::VectorXd& point) const {
  std::vector<double> values;
  values.reserve(parameters_.size());
  for (std::size_t k = 0; k < parameters_.size(); ++k) {
    values.push_back(value_within_bounds(parameters_[k], point[Eigen::Index(k)]));
  }
  return values;
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
  filming.see = [&](std::size_t query, std::size_t v, const splat::Image& image) {
    const Sighting& sighting = parts_.sightings[v];
    Coverage ours = seen_of(image.mask, sighting.matte, sighting.seen);
    blur(ours, blur_);
    const double weight = 1.0 / coverage_deviation(sighting.noise, std::hypot(blur_, kPixel));
    for (std::size_t i = 0; i < ours.values.size(); ++i) {
      images[query][Eigen::Index(first_[v] + i)] =
          weight * double(ours.values[i] - sighting.matte.values[i]);
    }
  };
  Scope scope;
  scope.until = parts_.window.until;
  scope.until[0] = std::max(scope.until[0], filming.until());
  scope.filming = &filming;
  if (!plan_.runs.empty()) scope.plan = &plan_;
  const Evaluation evaluation = model_.evaluate(values, scope);
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

Eigen::VectorXd ImageProblem::tail(const Eigen::VectorXd& residual) const {
  return residual.tail(residual.size() - Eigen::Index(first_.back()));
}

double ImageProblem::effective(const Eigen::VectorXd& residual) const {
  return outlines_ + (parts_.tracks != nullptr ? parts_.tracks->effective(tail(residual)) : 0.0);
}

ImageProblem::Misfit ImageProblem::misfit(const Eigen::VectorXd& residual) const {
  Misfit misfit{std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};
  const double images = residual.head(Eigen::Index(first_.back())).squaredNorm();
  if (outlines_ > 0.0) misfit.images = images / outlines_;
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
